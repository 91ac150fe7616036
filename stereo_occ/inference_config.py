"""Schemas of the configuration for using trained models: ``reconstruct`` and ``export``."""

from dataclasses import dataclass
from enum import Enum
from typing import Any

from omegaconf import MISSING


class Frame(Enum):
    """Of the written mesh."""

    left = "left"  # the left camera's: +X right, +Y down, +Z forward
    rig = "rig"  # origin about the object's centre, +X right, +Y up, +Z towards the cameras


class Backend(Enum):
    """What the model runs in."""

    torch = "torch"
    onnx = "onnx"


class Findable(Enum):
    """What can be looked for in a photograph."""

    mug = "mug"
    bowl = "bowl"
    bottle = "bottle"


@dataclass
class ReconstructConfig:
    """``python -m stereo_occ.reconstruct``"""

    left: str = MISSING  # image files
    right: str = MISSING
    calibration: Any = MISSING  # calibration file, or a list of two; rig= on the command line
    checkpoint: str = MISSING
    output: str = MISSING  # .glb, .obj, .ply or .stl
    unit: Any = None  # of the calibration's lengths: m, cm, mm, in, or metres as a number
    rectified: bool = MISSING  # the images are rectified already, by the calibration's P1 and P2
    left_box: list[float] | None = None  # left, top, right, bottom, pixels
    right_box: list[float] | None = None
    left_mask: str | None = None  # image files: the object white on black
    right_mask: str | None = None
    find: Findable | None = None  # in the left image, with torchvision's detector
    center: list[float] | None = None  # of the object, left camera's frame, metres
    size: float | None = None  # diagonal of the object's bounding box, metres
    mirror: bool | None = None  # ask about the mirror image too; null: if the training had mirror images
    threshold: float | None = None  # occupancy probability at the surface; null: the checkpoint's
    resolution: int = MISSING  # cells along each side of the working cube
    steps: int = MISSING  # of the search for each vertex's true place
    simplify: float | None = None  # metres that the surface may move for fewer faces
    color: bool = MISSING  # vertex colours from the images
    frame: Frame = MISSING
    preview: bool = MISSING  # write OUTPUT_preview.png
    backend: Backend = MISSING
    threads: int | None = None  # of torch or ONNX Runtime; null: theirs


@dataclass
class ExportConfig:
    """``python -m stereo_occ.export``"""

    checkpoint: str = MISSING
    output: str = MISSING  # path without a suffix
    half: bool = MISSING  # matrices and kernels in half precision
    onnx: bool = MISSING  # write the encoder and the decoder as ONNX too
    metrics: str | None = None  # metrics.json for the model card; null: the one beside the checkpoint
