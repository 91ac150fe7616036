"""Weights as files that only hold numbers: ``NAME.safetensors`` and, beside it, ``NAME.json`` that describes them.

Those in the folder ``weights`` of the package are shipped with it and known by their name.

Keys of the JSON file:
    version: of a checkpoint's form.
    config: the training configuration.
    step: of the training.
    threshold: decision threshold on the probability.
    metrics: of the evaluation, where there was one.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save
from torch import Tensor

from stereo_occ.errors import UserError
from stereo_occ.paths import PACKAGE
from stereo_occ.writing import write_whole

#: What is shipped.
FOLDER = PACKAGE / "weights"

SUFFIX = ".safetensors"


def shipped() -> list[str]:
    """Names of the weights in the package."""
    return sorted(path.stem for path in FOLDER.glob(f"*{SUFFIX}"))


def find_weights(name: str) -> Path | None:
    """The ``.safetensors`` file of a path, with or without that suffix, or of shipped weights' name; else None."""
    path = Path(name)
    if path.suffix == SUFFIX:
        return path
    folders = (path.parent, *([FOLDER] if path.name == name else []))
    files = [folder / f"{path.name}{SUFFIX}" for folder in folders]
    return None if path.is_file() else next((file for file in files if file.is_file()), None)


def read_weights(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """The description and the state dict, in single precision, of a ``.safetensors`` file.

    Raises:
        UserError: one of the two files is missing or damaged.
    """
    description_path = path.with_suffix(".json")
    try:
        description = json.loads(description_path.read_text(encoding="utf-8"))
        tensors = load_file(path)
    except OSError as error:
        raise UserError(
            f"checkpoint={path}: {error.filename or path} cannot be read ({error.strerror or error}); exported weights "
            f"are two files, {path.name} and {description_path.name}"
        ) from error
    except (SafetensorError, ValueError) as error:
        raise UserError(
            f"checkpoint={path}: it or {description_path.name} is damaged; export it again"
        ) from error
    if not isinstance(description, dict) or not isinstance(description.get("config"), dict):
        raise UserError(f"checkpoint={path}: {description_path.name} describes no weights; export it again")
    return description, {
        name: tensor.float() if tensor.is_floating_point() else tensor for name, tensor in tensors.items()
    }


def write_weights(
    path: Path, description: Mapping[str, Any], state_dict: Mapping[str, Tensor], half: bool
) -> None:
    """Write both files.

    Args:
        half: matrices and kernels in half precision; vectors, statistics of norms among them, stay in single.
    """
    tensors = {
        name: (
            tensor.half() if half and tensor.is_floating_point() and tensor.ndim > 1 else tensor
        ).contiguous()
        for name, tensor in state_dict.items()
    }
    if not all(torch.isfinite(tensor).all() for tensor in tensors.values() if tensor.is_floating_point()):
        raise UserError("half=true: some weights are too large for half precision; use half=false")
    text = json.dumps(description, indent=2, ensure_ascii=False) + "\n"
    write_whole(path.with_suffix(".json"), text.encode())
    write_whole(path, save(tensors))
