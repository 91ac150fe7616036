"""Checkpoints: what they hold beyond Lightning's own state, and reading them without executing code."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from omegaconf import DictConfig, OmegaConf

from stereo_occ.config import TrainConfig
from stereo_occ.data.rigs import build_rig
from stereo_occ.errors import UserError
from stereo_occ.models.build import build_model
from stereo_occ.packaged import find_weights, read_weights
from stereo_occ.saved_config import training_config

if TYPE_CHECKING:
    from stereo_occ.task import OccupancyTask

#: Where a checkpoint has the configuration, and the version of its form.
KEY, VERSION = "stereo_occ", 1


def plain(cfg: DictConfig) -> dict[str, Any]:
    """A configuration as nested plain dictionaries, interpolations resolved, enums by name."""
    container = OmegaConf.to_container(cfg, resolve=True, enum_to_str=True, throw_on_missing=True)
    assert isinstance(container, dict)
    return {str(key): value for key, value in container.items()}


def build_task(
    cfg: DictConfig, load_weights: bool = True, objects: Mapping[str, list[str]] | None = None
) -> OccupancyTask:
    """A fresh task for a training configuration.

    Args:
        objects: of the training, for its checkpoints; see :func:`~stereo_occ.data.objects.training_objects`.
        load_weights: read pretrained weights where the encoder asks for them; not needed before a checkpoint is loaded.
    """
    from stereo_occ.task import OccupancyTask  # Lightning, which takes seconds that only training needs

    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, TrainConfig)
    rig = build_rig(typed.rig, typed.data.image_side)
    return OccupancyTask(build_model(plain(cfg.model), rig, load_weights), typed, plain(cfg), objects)


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The contents of a checkpoint file; ``[KEY]["config"]`` is the training configuration, ``[KEY]["objects"]`` the
    identities of the training's objects by subset (missing where it was written before these were noted).

    Exported weights (``.safetensors``, or the name of some that are shipped) read as the checkpoint that they are of;
    their ``["metrics"]`` are those that they were exported with.

    Raises:
        UserError: the file is damaged, holds more than plain data, or is of another version.
    """
    if (weights := find_weights(str(path))) is not None:
        description, state_dict = read_weights(weights)
        checkpoint: Any = {
            KEY: {"version": VERSION, "config": description["config"]},
            "state_dict": state_dict,
            "global_step": description.get("step"),
            "metrics": description.get("metrics"),
        }
        if "objects" in description:
            checkpoint[KEY]["objects"] = description["objects"]
        return _checked(checkpoint, path)
    try:
        if not _is_as_written(path):
            raise UserError(
                f"checkpoint={path}: is damaged, its content differs from its checksums; copy it again, or give "
                f"another checkpoint of the run"
            )
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise UserError(f"checkpoint={path}: cannot be read ({error.strerror or error})") from error
    except UserError:
        raise
    except Exception as error:  # torch's own message advises to execute what the file holds
        raise UserError(
            f"checkpoint={path}: is damaged, or holds more than tensors and plain values; "
            f"give the best.ckpt or last.ckpt of a training run"
        ) from error
    return _checked(checkpoint, path)


def config_of(checkpoint: Mapping[str, Any], name: object) -> DictConfig:
    """The typed training configuration of a checkpoint that was read.

    Args:
        name: of the checkpoint, for messages.

    Raises:
        UserError: see :func:`~stereo_occ.config.training_config`.
    """
    try:
        return training_config(checkpoint[KEY].get("config"))
    except UserError as error:
        raise UserError(f"checkpoint={name}: {error}") from error


def _is_as_written(path: Path) -> bool:
    """Whether all that torch will read agrees with the checksums that it has written but does not read.

    Raises:
        Exception: the file is not what ``torch.save`` writes.
    """
    with zipfile.ZipFile(path) as archive:
        if any(record.compress_type != zipfile.ZIP_STORED for record in archive.infolist()):
            raise zipfile.BadZipFile(
                "torch compresses nothing"
            )  # and a small file could stand for a huge one
        return archive.testzip() is None


def _checked(checkpoint: Any, path: Path) -> dict[str, Any]:
    ours = checkpoint.get(KEY) if isinstance(checkpoint, dict) else None
    if not isinstance(ours, dict) or not {"state_dict", "global_step"} <= checkpoint.keys():
        raise UserError(
            f"checkpoint={path}: is no checkpoint of a training run; give its best.ckpt or last.ckpt"
        )
    if ours.get("version") != VERSION:
        raise UserError(
            f"checkpoint={path}: has format version {ours.get('version')}, expected {VERSION}; train it again"
        )
    return dict(checkpoint)
