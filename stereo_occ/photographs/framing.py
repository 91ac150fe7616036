"""How a checkpoint wants to see a pair: which part of the photographs, and the working cube in them.

- Trained with ``rig=rectified``: the pair is rectified, then cut to the object as ``geometry/cube.py`` says.
- Trained with ``rig=paper`` or ``rig=randomised``: the whole view of cameras that look at one point. The cube is about
  the point where the optical axes meet, and its unit such that the cameras are as far from it as in training. This
  needs a pair that is arranged as in training.
"""

from dataclasses import dataclass
from math import acos, asin, degrees

import numpy as np
from numpy.typing import NDArray

from stereo_occ.calibration import RealPair
from stereo_occ.data.placement import Placement
from stereo_occ.data.rigs import (
    RandomisedRigConfig,
    RectifiedRigConfig,
    RigConfig,
    ToedInRigConfig,
    build_rig,
)
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.geometry.crop import Box
from stereo_occ.geometry.cube import cube_at, ray, triangulate, working_cube
from stereo_occ.photographs.locate import Found
from stereo_occ.photographs.photo import pixels_in

#: How far a pair may be from the fixed one of a checkpoint, degrees and share of the distance.
ANGLE, DISTANCE = 2.0, 0.05

#: Metres to an object; the working cube of anything farther is less than a pixel.
FARTHEST = 100.0


@dataclass(frozen=True, eq=False)
class Framing:
    """The views that a model is given.

    Attributes:
        rig: cameras of the views; their rig frame is the cube's, in units of its side.
        cameras: the same in the left camera's frame, metres.
        cube_from_left: 4x4 similarity from there to the cube.
        unit: metres per unit of the cube.
        whole: cameras of the whole images that the views are parts of, metres.
        boxes: of the object in those.
    """

    rig: StereoRig
    cameras: tuple[Camera, Camera]
    cube_from_left: NDArray[np.float64]
    unit: float
    whole: StereoRig
    boxes: tuple[Box, Box]


def frame_on_object(
    pair: RealPair,
    config: RectifiedRigConfig,
    placement: Placement,
    side: int,
    found: tuple[Found, Found] | None,
    center_3: NDArray[np.float64] | None = None,
    size: float | None = None,
) -> Framing:
    """The pair rectified and cut to the object.

    Args:
        pair: fitted to its images.
        config, placement: of the training.
        side: of the views, pixels.
        found: the object in both photographs; None: a ball of ``size`` at ``center_3`` stands for it.
        center_3: where the object's centre is, left camera's frame, metres; None: where its boxes say.
        size: diagonal of the object's bounding box, metres; None: as its boxes say.

    Raises:
        UserError: if what is known does not say where the object is, or it is behind the cameras.
    """
    rig = pair.rectified()
    fill, margin = float(np.mean(config.fill)), float(np.mean(config.margin))
    if size is not None and not 0 < size < np.inf:
        raise UserError(f"size={size}: must be metres above 0, the diagonal of the object's bounding box")
    if placement is Placement.paper:
        fill = 1.0
        if size is None:
            raise UserError(
                "size: the checkpoint was trained knowing every object's size (placement=paper); give size=METRES, "
                "the diagonal of the object's bounding box"
            )
    if found is None:
        if center_3 is None or size is None:
            raise UserError(
                "the object cannot be found: give boxes, masks, or both center=[x,y,z] and size=METRES"
            )
        boxes = tuple(_ball_box(camera, center_3, size) for camera in rig.cameras)
    else:
        boxes = tuple(
            Box.around(pixels_in(target, camera, part.outline_N2))
            for target, camera, part in zip(rig.cameras, pair.cameras, found, strict=True)
        )
    left, right = boxes
    cube = working_cube(rig, (left, right), side, fill, margin)
    if center_3 is not None or size is not None:
        where_3 = cube_center(cube.cube_from_source) if center_3 is None else center_3
        unit = cube.unit if size is None else fill * size
        cube = cube_at(rig, (left, right), side, where_3, unit, margin)
    cameras = tuple(crop.camera(camera) for crop, camera in zip(cube.crops, rig.cameras, strict=True))
    return Framing(cube.rig, (cameras[0], cameras[1]), cube.cube_from_source, cube.unit, rig, (left, right))


def frame_on_fixation(pair: RealPair, config: RigConfig, side: int) -> Framing:
    """The whole view about the point where the optical axes meet.

    Raises:
        UserError: if they do not meet, or the pair is not arranged as in training.
    """
    rig = pair.pinholes()
    centers = tuple((float(camera.K[0, 2]), float(camera.K[1, 2])) for camera in rig.cameras)
    axes = [ray(camera, center) for camera, center in zip(rig.cameras, centers, strict=True)]
    advice = "this checkpoint needs cameras arranged as in its training; use one trained with rig=rectified"
    try:
        fixation_3 = triangulate(rig, (centers[0], centers[1]))
    except UserError as error:
        raise UserError(f"rig: the optical axes do not meet in front of the cameras; {advice}") from error
    distances = [float(np.linalg.norm(fixation_3 - camera.center)) for camera in rig.cameras]
    distance = float(np.mean(distances))
    angle = degrees(acos(np.clip(axes[0] @ axes[1], -1, 1)))
    trained = build_rig(config, side)
    away = float(np.mean([np.linalg.norm(camera.center) for camera in trained.cameras]))
    low, high = _angles(config)
    if not low - ANGLE <= angle <= high + ANGLE or abs(distances[0] / distances[1] - 1) > DISTANCE:
        raise UserError(
            f"rig: the optical axes meet at {angle:.1f} degrees, {distances[0]:.2f} and {distances[1]:.2f} m from the "
            f"cameras, in training at {low:.1f} to {high:.1f} degrees and equal distances; {advice}"
        )
    unit = distance / away
    whole = [Box(-0.5, -0.5, camera.width - 0.5, camera.height - 0.5) for camera in rig.cameras]
    views = [
        Camera(model.K, camera.camera_from_rig, side, side)
        for model, camera in zip(trained.cameras, rig.cameras, strict=True)
    ]
    cube = cube_at(rig, (whole[0], whole[1]), side, fixation_3, unit)
    told = [
        Camera(view.K, camera.camera_from_rig, side, side)
        for view, camera in zip(views, cube.rig.cameras, strict=True)
    ]
    return Framing(
        StereoRig(*told), (views[0], views[1]), cube.cube_from_source, unit, rig, (whole[0], whole[1])
    )


def _angles(config: RigConfig) -> tuple[float, float]:
    """Between the optical axes in training, degrees."""
    if isinstance(config, RandomisedRigConfig):
        low, high = (
            vergence * 2 * asin(min(1.0, baseline / 2 / distance))
            for vergence, baseline, distance in (
                (config.vergence[0], config.baseline[0], config.distance[1]),
                (config.vergence[1], config.baseline[1], config.distance[0]),
            )
        )
        return degrees(low), degrees(high)
    assert isinstance(config, ToedInRigConfig)
    return 2 * config.half_angle_deg, 2 * config.half_angle_deg


def _ball_box(camera: Camera, center_3: NDArray[np.float64], size: float) -> Box:
    """Of a ball whose outline has a box of that diagonal."""
    ((u, v),), (depth,) = camera.project(center_3[None])
    if depth <= size / 2:
        raise UserError(
            f"center={center_3.tolist()}: must be in front of the cameras, in metres of the left camera's frame "
            f"(right, down, forward)"
        )
    if depth > FARTHEST or not (-0.5 <= u <= camera.width - 0.5 and -0.5 <= v <= camera.height - 0.5):
        raise UserError(
            f"center={center_3.tolist()}: is at pixel ({u:.0f}, {v:.0f}) of an image of {camera.width} x "
            f"{camera.height}, {depth:.3g} m away; it must be in both images and at most {FARTHEST:g} m away"
        )
    reach = camera.K[0, 0] * size / 2**1.5 / depth
    return Box(u - reach, v - reach, u + reach, v + reach)


def cube_center(cube_from_source: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the similarity's cube ``(3,)``, in the frame that it leads from."""
    return np.asarray(np.linalg.solve(cube_from_source[:3, :3], -cube_from_source[:3, 3]))
