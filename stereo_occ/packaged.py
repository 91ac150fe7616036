"""Weights as files that only hold numbers: ``NAME.safetensors`` and, beside it, ``NAME.json`` that describes them.

Those in the folder ``weights`` of the package are shipped with it and known by their name.

Keys of the JSON file:
    version: :data:`VERSION`; 1 had no checksums.
    config: the training configuration.
    step: of the training.
    threshold: of the decision, whose rule is in the configuration.
    metrics: of the evaluation, where there was one.
    sha256: of each file beside it, by what its name has after that of the weights.
    checksum: SHA-256 of all this, as JSON with sorted keys.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from stereo_occ.errors import UserError
from stereo_occ.paths import PACKAGE
from stereo_occ.writing import write_whole

#: What is shipped.
FOLDER = PACKAGE / "weights"

#: The shipped weights for photographs.
DEFAULT = "field"

SUFFIX = ".safetensors"

#: Of the JSON file's form.
VERSION = 2


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


def is_there(name: str) -> bool:
    """Whether a checkpoint, or weights, can be read by that path or name."""
    return Path(name).is_file() or find_weights(name) is not None


def read_weights(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """The description and the state dict, in single precision, of a ``.safetensors`` file.

    Raises:
        UserError: one of the two files is missing, damaged or of another version.
    """
    description = read_description(path.with_suffix(".json"), path)
    try:
        tensors = load(checked_content(path, SUFFIX, description))
    except (SafetensorError, ValueError) as error:
        raise UserError(f"checkpoint={path}: is damaged; copy it again, or export it again") from error
    return description, {
        name: tensor.float() if tensor.is_floating_point() else tensor for name, tensor in tensors.items()
    }


def read_description(path: Path, asked: Path) -> dict[str, Any]:
    """What the JSON file says.

    Args:
        asked: the file that messages name.

    Raises:
        UserError: it is missing, damaged or of another version.
    """
    try:
        description = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(
            f"checkpoint={asked}: {path} cannot be read ({error.strerror or error}); exported weights are two files, "
            f"{path.with_suffix(SUFFIX).name} and {path.name}"
        ) from error
    except (ValueError, RecursionError) as error:
        raise UserError(
            f"checkpoint={asked}: {path.name} is damaged; copy it again, or export it again"
        ) from error
    if not (
        isinstance(description, dict)
        and isinstance(description.get("config"), dict)
        and isinstance(description.get("sha256", {}), dict)
    ):
        raise UserError(f"checkpoint={asked}: {path.name} describes no weights; export it again")
    if description.get("version") not in (1, VERSION):
        raise UserError(
            f"checkpoint={asked}: {path.name} has format version {description.get('version')}, expected 1 or "
            f"{VERSION}; export it again, or update stereo-occ"
        )
    if description["version"] == VERSION and description.get("checksum") != _checksum(description):
        raise UserError(
            f"checkpoint={asked}: {path.name} is damaged, it differs from its checksum; copy it again, or export it "
            f"again"
        )
    return description


def checked_content(path: Path, suffix: str, description: Mapping[str, Any]) -> bytes:
    """The bytes of a file that belongs to a description, compared with the checksum that it has there.

    Args:
        suffix: what the file's name has after that of the weights.

    Raises:
        UserError: it cannot be read, or is another than was described.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(
            f"checkpoint={path}: cannot be read ({error.strerror or error}); exported weights are two files, "
            f"{path.name} and {path.with_suffix('.json').name}"
        ) from error
    sums = description.get("sha256", {})
    if description["version"] == VERSION and sums.get(suffix) != hashlib.sha256(content).hexdigest():
        raise UserError(
            f"checkpoint={path}: is damaged, or of another export than its description; copy it again, or export it "
            f"again"
        )
    return content


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
    write_whole(path, save(tensors))
    write_description(path.with_suffix(".json"), description, {SUFFIX: path})


def write_description(path: Path, description: Mapping[str, Any], files: Mapping[str, Path]) -> None:
    """Write the JSON file with the checksums of what it describes.

    Args:
        files: by what their names have after that of the weights.
    """
    sums = {suffix: hashlib.sha256(file.read_bytes()).hexdigest() for suffix, file in files.items()}
    content = {"version": VERSION, **description, "sha256": sums}
    text = json.dumps({**content, "checksum": _checksum(content)}, indent=2, ensure_ascii=False) + "\n"
    write_whole(path, text.encode())


def _checksum(description: Mapping[str, Any]) -> str:
    """SHA-256 of all but itself."""
    content = {key: value for key, value in description.items() if key != "checksum"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
