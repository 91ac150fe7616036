"""Where the object is in each view."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from omegaconf import MISSING
from scipy.spatial.transform import Rotation

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.ranges import draw, share

ATTEMPTS = 10_000

# A unit diagonal at the fixation point of the paper's rig touches the views' borders, and must not fail by rounding.
ROUNDING = 1e-9  # metres


class Placement(Enum):
    """Where the object is."""

    paper = "paper"  # unit diagonal, centred at the fixation point
    free = "free"  # diagonal log-uniform in [0.4, 1], centre anywhere that keeps it in both views and in the cube


@dataclass
class StandingConfig:
    """Objects on something level, their +Y up, instead of turned at random."""

    elevation_deg: list[float] = MISSING  # of the cameras above the object's horizon
    roll_deg: list[float] = MISSING  # of the cameras about their line of sight
    lying: float = MISSING  # share of objects that lie on their side


@dataclass
class PlacementConfig:
    """Where the object is."""

    kind: Placement = MISSING
    diagonal: list[float] = MISSING  # log-uniform range of the bounding box diagonal, metres
    standing: StandingConfig | None = None


def draw_pose(kind: str, diagonal: tuple[float, float], rig: StereoRig, rng: np.random.Generator) -> Pose:
    """A pose with uniform rotation, at the fixation point (``paper``) or anywhere that stays visible (``free``).

    Both draw the box diagonal log-uniformly from ``diagonal``; ``free`` draws the centre uniformly over the places
    where the bounding sphere lies inside the cube ``[-0.5, 0.5]^3`` and inside both views.

    Raises:
        UserError: the rig leaves no place for the object.
    """
    rotation = random_rotations(1, rng)[0]
    scale = float(np.exp(rng.uniform(*np.log(diagonal))))
    if kind == "paper":
        return Pose(rotation, scale, np.zeros(3))
    for _ in range(ATTEMPTS):
        center = rng.uniform(-0.5, 0.5, 3) * (1 - scale)
        if in_view(rig, center, scale):
            return Pose(rotation, scale, center)
    raise UserError(
        f"placement=free: no place for an object of diagonal {scale:.2f} m is inside both views; "
        f"widen rig.fov_deg or lower placement.diagonal"
    )


def in_view(rig: StereoRig, center_3: NDArray[np.float64], diagonal: float) -> bool:
    """Whether the bounding sphere of an object is whole in both images."""
    return all(camera.clearance(center_3) >= diagonal / 2 - ROUNDING for camera in rig.cameras)


def draw_standing(
    config: StandingConfig, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """An orientation of an object on something level, turned at random about the vertical.

    Returns:
        Rotation ``(3, 3)`` from object to rig frame, and the unit vector ``(3,)`` upwards in the rig frame.

    Raises:
        UserError: for a range out of its limits.
    """
    elevation = draw(config.elevation_deg, "placement.standing.elevation_deg", rng, -90, 90)
    roll = draw(config.roll_deg, "placement.standing.roll_deg", rng, -90, 90)
    spin, yaw = rng.uniform(0, 360, 2)
    lies = rng.random() < share(config.lying, "placement.standing.lying")
    rig_from_level = Rotation.from_euler("ZX", [roll, elevation], degrees=True)
    on_level = Rotation.from_euler("YXY", [yaw, 90.0 if lies else 0.0, spin], degrees=True)
    return (rig_from_level * on_level).as_matrix(), rig_from_level.apply([0.0, 1.0, 0.0])
