"""Checkpoints as runs leave them, of untrained models."""

from pathlib import Path

import torch
from omegaconf import OmegaConf
from samples import TINY

from stereo_occ.checkpoint import KEY, VERSION, plain
from stereo_occ.cli import compose_config
from stereo_occ.data.rigs import build_rig
from stereo_occ.models.build import build_model


def checkpoint_of(folder: Path, *overrides: str, name: str = "best.ckpt", **more) -> Path:
    """Of a model that looks at objects in rectified pairs and says something about every point.

    Args:
        more: in place of, or beside, what a checkpoint holds.
    """
    cfg = compose_config("train", [*TINY, "rig=rectified", "placement=free", *overrides])
    torch.manual_seed(0)
    model = build_model(plain(cfg.model), build_rig(OmegaConf.to_object(cfg.rig), cfg.data.image_side))
    *_, head = model.decoder.head.modules()  # so that it says yes here and no there
    torch.nn.init.normal_(head.weight, std=5)
    torch.nn.init.zeros_(head.bias)
    state = {f"model.{name}": tensor for name, tensor in model.state_dict().items()}
    content = {
        KEY: {"version": VERSION, "config": plain(cfg)},
        "global_step": 7,
        "state_dict": state | {"threshold": torch.tensor(0.4)},
    }
    path = folder / name
    torch.save(content | more, path)
    return path
