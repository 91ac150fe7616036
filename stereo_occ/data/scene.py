"""What is where in a view: cameras as told and as they are, the object's pose, which way is up."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from stereo_occ.data.placement import Placement, PlacementConfig, draw_pose, draw_standing, in_view
from stereo_occ.data.rigs import (
    DISTANCE,
    RandomisedRigConfig,
    RectifiedRigConfig,
    RigConfig,
    ToedInRigConfig,
    build_rig,
    draw_parallel,
    draw_verging,
    perturbed,
)
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.geometry.crop import Box
from stereo_occ.geometry.cube import WorkingCube, cube_at, view_axes, working_cube
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.ranges import bounds, draw, share

ATTEMPTS = 1000


@dataclass(frozen=True, eq=False)
class Scene:
    """A view before it is rendered.

    Attributes:
        rig: the cameras that the model is told.
        true_rig: the cameras that take the pictures.
        pose: of the object in the rig frame.
        up_3: unit vector upwards in the rig frame, where the placement says which way that is.
        unit: metres per unit of the rig frame.
    """

    rig: StereoRig
    true_rig: StereoRig
    pose: Pose
    up_3: NDArray[np.float64] | None = None
    unit: float = 1.0


def draw_scene(
    config: RigConfig,
    placement: PlacementConfig,
    side: int,
    hull_N3: NDArray[np.float64],
    rng: np.random.Generator,
    spare: np.random.Generator,
) -> Scene:
    """A view of one object.

    ``rng`` gives the object's orientation and size, and with a fixed rig its place, so that what is drawn from it next
    does not depend on the rig; all else comes from ``spare``.

    Args:
        side: of the images, pixels.
        hull_N3: points of the object frame whose convex hull is the object's.

    Raises:
        UserError: for a range out of its limits, or where no view holds the object whole.
    """
    if isinstance(config, ToedInRigConfig):
        rig = build_rig(config, side)
        low, high = placement.diagonal
        scene = Scene(rig, rig, draw_pose(placement.kind.value, (low, high), rig, rng))
        if placement.standing is None:
            return scene
        turned_33, upwards_3 = draw_standing(placement.standing, spare)
        return replace(scene, pose=replace(scene.pose, rotation_33=turned_33), up_3=upwards_3)
    rotation_33, size = random_rotations(1, rng)[0], rng.random()
    attempt = _attempt(config, placement, side, hull_N3, size)
    up_3: NDArray[np.float64] | None = None
    for _ in range(ATTEMPTS):
        if placement.standing is not None:
            rotation_33, up_3 = draw_standing(placement.standing, spare)
        found = attempt(rotation_33, up_3, spare)
        if found is not None:
            return found
        rotation_33 = random_rotations(1, spare)[0]
    raise UserError(
        f"rig={config.kind}: {ATTEMPTS} tries gave no view with the object whole in both images and in the cube; "
        f"widen rig.fov_deg, rig.distance or placement.diagonal"
    )


Attempt = Callable[[NDArray[np.float64], NDArray[np.float64] | None, np.random.Generator], Scene | None]


def _attempt(
    config: RigConfig, placement: PlacementConfig, side: int, hull_N3: NDArray[np.float64], size: float
) -> Attempt:
    if isinstance(config, RandomisedRigConfig):
        diagonal = _between(placement.diagonal, size)
        return partial(_randomised, config, placement.kind, side, diagonal)
    assert isinstance(config, RectifiedRigConfig)
    diagonal = _between(bounds(config.diagonal, "rig.diagonal", 1e-3, np.inf), size)
    return partial(_rectified, config, placement, side, hull_N3, diagonal)


def _between(limits: tuple[float, float] | list[float], fraction: float) -> float:
    low, high = np.log(limits)
    return float(np.exp(low + fraction * (high - low)))


def _randomised(
    config: RandomisedRigConfig,
    kind: Placement,
    side: int,
    diagonal: float,
    rotation_33: NDArray[np.float64],
    up_3: NDArray[np.float64] | None,
    rng: np.random.Generator,
) -> Scene | None:
    rig = draw_verging(config, side, rng)
    center_3 = np.zeros(3)
    if kind is Placement.free:
        center_3 = rng.uniform(-0.5, 0.5, 3) * (1 - diagonal)
    if not in_view(rig, center_3, diagonal):
        return None
    return Scene(rig, perturbed(rig, config.errors, rng), Pose(rotation_33, diagonal, center_3), up_3)


def _rectified(
    config: RectifiedRigConfig,
    placement: PlacementConfig,
    side: int,
    hull_N3: NDArray[np.float64],
    diagonal: float,
    rotation_33: NDArray[np.float64],
    up_3: NDArray[np.float64] | None,
    rng: np.random.Generator,
) -> Scene | None:
    """Orientations are drawn as the line of sight to the object sees them, as with the other rigs."""
    rig = draw_parallel(config, rng)
    distance = draw(config.distance, "rig.distance", rng, 0.05, DISTANCE[1])
    pixel_12 = rng.uniform([[0, 0]], [[config.width, config.height]]) - 0.5
    (center_3,) = rig.left.unproject(pixel_12, np.ones(1)) - rig.left.center
    center_3 = rig.left.center + distance * center_3 / np.linalg.norm(center_3)
    true_rig = perturbed(rig, config.errors, rng)
    if not (in_view(rig, center_3, diagonal) and in_view(true_rig, center_3, diagonal)):
        return None
    source_from_view = view_axes(rig, center_3).T
    pose = Pose(source_from_view @ rotation_33, diagonal, center_3)
    boxes = _found_boxes(config, true_rig, pose.to_rig(hull_N3), rng)
    cube = _cube(config, placement.kind, rig, boxes, side, pose, rng)
    if cube is None:
        return None
    posed = Pose.from_matrix(cube.cube_from_source @ pose.rig_from_object)
    low, high = placement.diagonal
    if placement.kind is Placement.free and not (
        low <= posed.scale <= high and np.abs(posed.to_rig(hull_N3)).max() <= 0.5
    ):
        return None
    if up_3 is not None:
        up_3 = cube.unit * cube.cube_from_source[:3, :3] @ source_from_view @ up_3
    return Scene(cube.rig, cube.cut(true_rig), posed, up_3, cube.unit)


def _found_boxes(
    config: RectifiedRigConfig, rig: StereoRig, points_N3: NDArray[np.float64], rng: np.random.Generator
) -> tuple[Box, Box]:
    """What a detector says of the object in both images."""
    left, right = (Box.around(camera.project(points_N3)[0]) for camera in rig.cameras)
    extent = max(left.right - left.left, left.bottom - left.top)
    edges_4 = share(config.box_error, "rig.box_error", 0.2) * extent * rng.standard_normal(4).clip(-2, 2)
    shift = share(config.match_error, "rig.match_error", 100) * rng.standard_normal()
    return _moved(left, edges_4), _moved(right, edges_4 + shift * np.array([1, 0, 1, 0]))


def _moved(box: Box, edges_4: NDArray[np.float64]) -> Box:
    return Box(*(np.array([box.left, box.top, box.right, box.bottom]) + edges_4).tolist())


def _cube(
    config: RectifiedRigConfig,
    kind: Placement,
    rig: StereoRig,
    boxes: tuple[Box, Box],
    side: int,
    pose: Pose,
    rng: np.random.Generator,
) -> WorkingCube | None:
    """About the object itself where the placement says so, else what its boxes tell; None if that is nothing."""
    fill = draw(config.fill, "rig.fill", rng, 0.1, 10)
    margin = draw(config.margin, "rig.margin", rng, 0.1, 10)
    if kind is Placement.paper:
        return cube_at(rig, boxes, side, pose.center_3, pose.scale, margin)
    try:
        return working_cube(rig, boxes, side, fill, margin)
    except UserError:
        return None
