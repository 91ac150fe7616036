"""Schemas of the configuration group ``baseline``: what needs no training of a network."""

from dataclasses import dataclass

from omegaconf import MISSING

#: OpenCV keeps costs as 16-bit integers; with larger blocks the smoothness penalty overflows them.
LARGEST_PENALTY = 32767


@dataclass
class BaselineConfig:
    """Any baseline."""

    name: str = MISSING


@dataclass
class VisualHullConfig(BaselineConfig):
    """What both true masks allow."""

    name: str = "visual_hull"


@dataclass
class SemiGlobalMatchingConfig(BaselineConfig):
    """The visual hull, carved by the depth that OpenCV's semi-global matching finds."""

    name: str = "sgm"
    enlarge: int = MISSING  # pixels of the rectified images per pixel of the given ones, along each side
    block: int = MISSING  # side of the matched blocks, rectified pixels, odd
    smoothness: float = MISSING  # of the disparity; 1: what OpenCV's documentation advises
    uniqueness: int = MISSING  # percent by which the best match must be better than the second
    allowance: float = MISSING  # metres by which the object may begin in front of the matched surface


@dataclass
class MeanShapeConfig(BaselineConfig):
    """The mean of the training objects in all their poses, the same answer to every picture."""

    name: str = "mean_shape"
    cells: int = MISSING  # per side of the working cube
    views: int = MISSING  # poses of each training object


@dataclass
class NearestShapeConfig(BaselineConfig):
    """The training object most like the true one, at the true pose."""

    name: str = "nearest_shape"
    cells: int = MISSING  # per side of the grid on which objects are compared


@dataclass
class TruthConfig(BaselineConfig):
    """The object itself."""

    name: str = "truth"


BASELINE_SCHEMAS: dict[str, type[BaselineConfig]] = {
    schema.name: schema
    for schema in (
        VisualHullConfig,
        SemiGlobalMatchingConfig,
        MeanShapeConfig,
        NearestShapeConfig,
        TruthConfig,
    )
}


def baseline_problems(config: BaselineConfig) -> list[str]:
    """What is wrong with the values of a configuration, one line each."""
    problems = [
        f"baseline.{name}={value}: must be at least 1"
        for name in ("enlarge", "block", "cells", "views")
        if (value := getattr(config, name, 1)) < 1
    ]
    if isinstance(config, SemiGlobalMatchingConfig):
        if config.block % 2 == 0:
            problems.append(f"baseline.block={config.block}: must be odd")
        if not 0 < 32 * config.smoothness * 3 * config.block**2 <= LARGEST_PENALTY:
            problems.append(
                f"baseline.smoothness={config.smoothness}: must be above 0 and at most "
                f"{LARGEST_PENALTY / 96 / config.block**2:.3g} with baseline.block={config.block}"
            )
    return problems
