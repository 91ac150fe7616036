"""Rendered pairs as files: two photographs, two masks, and the calibration with what only the renderer knows."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from experiments.path_traced.real_objects import own
from experiments.whole_pairs import Photographs
from stereo_occ.calibration import read_calibration
from stereo_occ.data.objects import ObjectSource
from stereo_occ.geometry.camera import StereoRig

OUTPUT = Path("outputs/path_traced")

SIDES = ("left", "right")


@dataclass(frozen=True, eq=False)
class RenderedPair:
    """A pair with its place in the set; ``look``: what the object is made of."""

    source: ObjectSource
    view: int
    look: str
    photographs: Photographs


def folder_of(output: Path, source: ObjectSource, view: int) -> Path:
    """Where a pair is; not there until it is complete."""
    return output / f"{source.category}_{source.object_id}_{view}"


def write_pair(
    folder: Path,
    rgb_2HW3: NDArray[np.uint8],
    mask_2HW: NDArray[np.bool_],
    rig: StereoRig,
    left_from_object: NDArray[np.float64],
    look: str,
) -> None:
    """All of a pair or nothing; ``pair.json`` is a calibration that ``reconstruct`` reads."""
    partial = folder.with_name(f".{folder.name}")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    facts: dict[str, Any] = {"look": look, "left_from_object": left_from_object.tolist(), "unit": "m"}
    for side, rgb_HW3, mask_HW, camera in zip(SIDES, rgb_2HW3, mask_2HW, rig.cameras, strict=True):
        Image.fromarray(rgb_HW3).save(partial / f"{side}.png")
        Image.fromarray(mask_HW).save(partial / f"{side}_mask.png")
        facts[side] = {
            "width": camera.width,
            "height": camera.height,
            "K": camera.K.tolist(),
            "camera_from_rig": camera.camera_from_rig.tolist(),
        }
    (partial / "pair.json").write_text(json.dumps(facts, indent=1) + "\n")
    partial.rename(folder)


def read_pairs(output: Path, sources: list[ObjectSource], views: range) -> Iterator[RenderedPair]:
    """Those that are there."""
    for view in views:
        for source in sources:
            folder = folder_of(output, source, view)
            if folder.exists():
                yield RenderedPair(source, view, *_read(folder, source))


def _read(folder: Path, source: ObjectSource) -> tuple[str, Photographs]:
    facts = json.loads((folder / "pair.json").read_text())
    photographs = Photographs(
        np.stack([np.asarray(Image.open(folder / f"{side}.png")) for side in SIDES]),
        np.stack([np.asarray(Image.open(folder / f"{side}_mask.png"), bool) for side in SIDES]),
        read_calibration(folder / "pair.json"),
        np.array(facts["left_from_object"]),
        own(source).mesh,
    )
    return facts["look"], photographs
