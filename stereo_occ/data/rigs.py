"""Which cameras: the paper's fixed pair, randomised toed-in pairs, or parallel pairs as sold for robots."""

from dataclasses import dataclass, field
from math import asin, cos, radians, sin, tan

import numpy as np
from numpy.typing import NDArray
from omegaconf import MISSING
from scipy.spatial.transform import Rotation

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig, centered_intrinsics, intrinsics, toed_in_rig
from stereo_occ.geometry.crop import Box
from stereo_occ.geometry.cube import cube_at
from stereo_occ.ranges import bounds, draw, share


@dataclass
class CalibrationErrorConfig:
    """How far the cameras that take the pictures are from those that the model is told: standard deviations."""

    rotation_deg: float = 0.0  # about each axis of each camera
    focal_percent: float = 0.0  # of each camera
    principal_px: float = 0.0  # in u and v of each camera, pixels of its whole image


@dataclass
class RigConfig:
    """Two cameras."""

    kind: str = "toed_in"


@dataclass
class ToedInRigConfig(RigConfig):
    """Two cameras on a circle about the fixation point: the paper's."""

    kind: str = "toed_in"
    distance: float = MISSING  # metres from each camera to the fixation point
    half_angle_deg: float = MISSING  # angle of each camera from the mid-line
    fov_deg: float = MISSING  # vertical field of view


@dataclass
class RandomisedRigConfig(RigConfig):
    """Another pair for every view: the working cube stays 1 metre about the point that both cameras surround."""

    kind: str = "randomised"
    distance: list[float] = MISSING  # metres from each camera to the cube's centre
    baseline: list[float] = MISSING  # metres
    vergence: list[float] = MISSING  # 1: both look at the cube's centre; 0: parallel
    fov_deg: list[float] = MISSING  # vertical field of view
    errors: CalibrationErrorConfig = field(default_factory=CalibrationErrorConfig)


@dataclass
class RectifiedRigConfig(RigConfig):
    """A parallel pair that sees the object anywhere in its images, cropped to it as ``geometry/cube.py`` says."""

    kind: str = "rectified"
    baseline: list[float] = MISSING  # metres
    distance: list[float] = MISSING  # metres from the cameras to the object, uniform
    diagonal: list[float] = MISSING  # of the object's bounding box, metres, log-uniform
    fov_deg: list[float] = MISSING  # horizontal, of the whole image
    width: int = MISSING  # of the whole image, pixels
    height: int = MISSING
    fill: list[float] = MISSING  # side of the cube over the box's diagonal
    margin: list[float] = MISSING  # side of the crop over that of the box
    box_error: float = (
        MISSING  # of each edge of the box, the same in both images: share of the box's side, std
    )
    match_error: float = MISSING  # of the right box's place along the row: pixels of the whole image, std
    errors: CalibrationErrorConfig = field(default_factory=CalibrationErrorConfig)


RIG_SCHEMAS: dict[str, type[RigConfig]] = {
    schema.kind: schema for schema in (ToedInRigConfig, RandomisedRigConfig, RectifiedRigConfig)
}


def build_rig(config: RigConfig, side: int) -> StereoRig:
    """The cameras of a configuration for images of ``side`` pixels; of those that vary, the middle of each range."""
    if isinstance(config, RandomisedRigConfig):
        middle = {name: float(np.mean(getattr(config, name))) for name in RANDOMISED}
        return _verging(side, **middle)
    if isinstance(config, RectifiedRigConfig):
        return _typical_crop(config, side)
    assert isinstance(config, ToedInRigConfig)
    return toed_in_rig(config.distance, radians(config.half_angle_deg), radians(config.fov_deg), side)


#: Limits of what cameras can be for objects of at most a metre: metres, degrees, degrees.
DISTANCE = (0.1, 100.0)
HALF_ANGLE = (0.01, 89.0)
FOV = (1.0, 170.0)

#: Ranges of a randomised rig with their limits.
RANDOMISED = {
    "distance": DISTANCE,
    "baseline": (0.0, 2 * DISTANCE[1]),
    "vergence": (0.0, 1.0),
    "fov_deg": FOV,
}


def draw_verging(config: RandomisedRigConfig, side: int, rng: np.random.Generator) -> StereoRig:
    """A toed-in pair from the ranges.

    Raises:
        UserError: for a range out of its limits, or a baseline longer than twice the distance.
    """
    values = {
        name: draw(getattr(config, name), f"rig.{name}", rng, *limits) for name, limits in RANDOMISED.items()
    }
    return _verging(side, **values)


def draw_parallel(config: RectifiedRigConfig, rng: np.random.Generator) -> StereoRig:
    """A parallel pair, whole images; rig frame: the middle between the cameras, +Y up, +Z backwards, metres.

    Raises:
        UserError: for a range out of its limits or an image without pixels.
    """
    baseline = draw(config.baseline, "rig.baseline", rng, 1e-3, 2 * DISTANCE[1])
    fov = radians(draw(config.fov_deg, "rig.fov_deg", rng, *FOV))
    return _parallel(config, baseline, fov)


def perturbed(rig: StereoRig, errors: CalibrationErrorConfig, rng: np.random.Generator) -> StereoRig:
    """The cameras as they really are, when ``rig`` is what a calibration with ``errors`` says of them.

    Raises:
        UserError: for a negative error.
    """
    for name, most in (("rotation_deg", 45), ("focal_percent", 50), ("principal_px", 1e4)):
        share(getattr(errors, name), f"rig.errors.{name}", most)
    left, right = (_perturbed(camera, errors, rng.standard_normal(6)) for camera in rig.cameras)
    return StereoRig(left, right)


def _perturbed(camera: Camera, errors: CalibrationErrorConfig, normal_6: NDArray[np.float64]) -> Camera:
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec(errors.rotation_deg * normal_6[:3], degrees=True).as_matrix()
    K = camera.K.copy()
    K[[0, 1], [0, 1]] *= max(0.1, 1 + errors.focal_percent / 100 * normal_6[3])
    K[:2, 2] += errors.principal_px * normal_6[4:]
    return Camera(K, turn @ camera.camera_from_rig, camera.width, camera.height)


def _verging(side: int, distance: float, baseline: float, vergence: float, fov_deg: float) -> StereoRig:
    if not 0 < baseline < 2 * distance:
        raise UserError(
            f"rig.baseline: must be above 0 and below twice the distance of {distance:.3g} m, got {baseline:.3g}"
        )
    K, half_angle = intrinsics(radians(fov_deg), side), asin(baseline / 2 / distance)
    cameras = []
    for angle in (-half_angle, half_angle):
        center_3 = distance * np.array([sin(angle), 0, cos(angle)])
        c, s = cos(vergence * angle), sin(vergence * angle)
        camera_from_rig = np.eye(4)
        camera_from_rig[:3, :3] = np.array([[c, 0, -s], [0, -1, 0], [-s, 0, -c]])
        camera_from_rig[:3, 3] = -camera_from_rig[:3, :3] @ center_3
        cameras.append(Camera(K, camera_from_rig, side, side))
    return StereoRig(*cameras)


def _parallel(config: RectifiedRigConfig, baseline: float, fov: float) -> StereoRig:
    if min(config.width, config.height) < 1:
        raise UserError(
            f"rig.width, rig.height: must be at least 1 pixel, got {config.width} x {config.height}"
        )
    K = centered_intrinsics(config.width / 2 / tan(fov / 2), config.width, config.height)
    cameras = []
    for x in (-baseline / 2, baseline / 2):
        camera_from_rig = np.diag([1.0, -1.0, -1.0, 1.0])
        camera_from_rig[0, 3] = -x
        cameras.append(Camera(K, camera_from_rig, config.width, config.height))
    return StereoRig(*cameras)


def _typical_crop(config: RectifiedRigConfig, side: int) -> StereoRig:
    """A ball of middling size at a middling distance in the middle of the images."""
    ranges = {
        name: bounds(getattr(config, name), f"rig.{name}", 0, np.inf)
        for name in ("baseline", "fov_deg", "distance", "diagonal", "fill", "margin")
    }
    middle = {name: float(np.mean(limits)) for name, limits in ranges.items()}
    rig = _parallel(config, middle["baseline"], radians(middle["fov_deg"]))
    center_3 = np.array([0, 0, -middle["distance"]])
    radius = middle["diagonal"] / 2**1.5  # of a ball whose outline has a box of that diagonal
    boxes = []
    for camera in rig.cameras:
        ((u, v),), (depth,) = camera.project(center_3[None])
        reach = camera.K[0, 0] * radius / depth
        boxes.append(Box(u - reach, v - reach, u + reach, v + reach))
    unit = middle["fill"] * middle["diagonal"]
    return cube_at(rig, (boxes[0], boxes[1]), side, center_3, unit, middle["margin"]).rig
