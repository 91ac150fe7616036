"""The working cube of a calibrated pair in which an object has been found: from two boxes to what networks take.

The networks know one frame: the cube ``[-0.5, 0.5]^3`` about a point where the object is. A pair of photographs has
cameras in metres and a box around the object in each image. :func:`working_cube` leads from one to the other, for
rendered pairs and photographs alike:

- The cube's centre is where the rays through the centres of both boxes come nearest to each other.
- Its +Z points from there to the midpoint of both cameras, +X is as nearly along the baseline, left to right, as
  that allows, +Y is up in the images. For the paper's toed-in rig this is the rig frame.
- Its side is ``fill`` times the diagonal of the box at the centre's distance: known from the pictures alone, so it
  does not betray the object's true size.
- Both images are cut to squares of one size on the same rows, each about its own box, so that rows of a rectified
  pair stay rows; intrinsics move along, extrinsics are in units of the cube's side. A picture does not change when
  the scene and the baseline grow together, so nothing is lost, and :attr:`WorkingCube.unit` leads back to metres.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.geometry.crop import Box, Crop

#: Side of the cube over the box's diagonal: the diagonal of nearly every object is then 0.4 to 1 of the cube.
FILL = 1.5

#: Side of a crop over that of the box.
MARGIN = 1.25


@dataclass(frozen=True, eq=False)
class WorkingCube:
    """A pair cut to its object.

    Attributes:
        rig: cameras of the crops; their rig frame is the cube's, in units of its side.
        crops: left and right, in the images given.
        cube_from_source: 4x4 similarity from the frame of the cameras given, metres.
        unit: metres per unit of the cube: its side.
    """

    rig: StereoRig
    crops: tuple[Crop, Crop]
    cube_from_source: NDArray[np.float64]
    unit: float

    def cut(self, rig: StereoRig) -> StereoRig:
        """Other cameras of the same whole images (frame of those given), cut in the same way."""
        return _cut(rig, self.crops, self.cube_from_source, self.unit)


def working_cube(
    rig: StereoRig, boxes: tuple[Box, Box], side: int, fill: float = FILL, margin: float = MARGIN
) -> WorkingCube:
    """The cube about the object in two boxes, and the crops that show it.

    Args:
        rig: the cameras of the whole images in any frame, metres; upright, left camera left.
        boxes: around the object in the left and the right image.
        side: of the crops, pixels.
        fill, margin: see :data:`FILL` and :data:`MARGIN`.

    Raises:
        UserError: if the rays through the boxes do not meet in front of the cameras, or left and right are swapped.
    """
    center_3 = triangulate(rig, (boxes[0].center, boxes[1].center))
    unit = fill * float(np.mean([_diagonal(c, b, center_3) for c, b in zip(rig.cameras, boxes, strict=True)]))
    return cube_at(rig, boxes, side, center_3, unit, margin)


def cube_at(
    rig: StereoRig,
    boxes: tuple[Box, Box],
    side: int,
    center_3: NDArray[np.float64],
    unit: float,
    margin: float = MARGIN,
) -> WorkingCube:
    """As :func:`working_cube`, where the centre (frame of the cameras) and side of the cube, metres, are known."""
    axes_33 = view_axes(rig, center_3)
    cube_from_source = np.eye(4)
    cube_from_source[:3, :3] = axes_33 / unit
    cube_from_source[:3, 3] = -axes_33 @ center_3 / unit
    crops = _crops(boxes, side, margin)
    return WorkingCube(_cut(rig, crops, cube_from_source, unit), crops, cube_from_source, unit)


def triangulate(
    rig: StereoRig, pixels: tuple[tuple[float, float], tuple[float, float]]
) -> NDArray[np.float64]:
    """The point ``(3,)`` nearest to the rays through a pixel of each image: the middle of their common normal.

    Raises:
        UserError: if the rays do not come together in front of both cameras.
    """
    rays_23 = np.stack([ray(camera, pixel) for camera, pixel in zip(rig.cameras, pixels, strict=True)])
    between_3 = rig.right.center - rig.left.center
    cosine = rays_23[0] @ rays_23[1]
    along_2 = rays_23 @ between_3
    determinant = 1 - cosine**2
    if determinant < 1e-12:
        raise UserError(
            "boxes: their rays are parallel, so the object is at no distance; check left and right"
        )
    far_left = (along_2[0] - cosine * along_2[1]) / determinant
    far_right = (cosine * along_2[0] - along_2[1]) / determinant
    if not (far_left > 0 and far_right > 0):
        raise UserError(
            "boxes: their rays meet behind the cameras; are they of one object, and left and right not swapped?"
        )
    ends_23 = np.stack([rig.left.center + far_left * rays_23[0], rig.right.center + far_right * rays_23[1]])
    return np.asarray(ends_23.mean(axis=0))


def ray(camera: Camera, pixel: tuple[float, float]) -> NDArray[np.float64]:
    """Unit direction ``(3,)`` of the line of sight through a pixel, in the camera's rig frame."""
    direction_3 = camera.camera_from_rig[:3, :3].T @ np.linalg.solve(camera.K, [*pixel, 1.0])
    return np.asarray(direction_3 / np.linalg.norm(direction_3))


def _diagonal(camera: Camera, box: Box, center_3: NDArray[np.float64]) -> float:
    """Of the box, metres, at the centre's distance; from angles, so that turning the camera does not change it."""
    u, v = box.center
    spans = [((box.left, v), (box.right, v)), ((u, box.top), (u, box.bottom))]
    angles_2 = [np.arccos(np.clip(ray(camera, a) @ ray(camera, b), -1, 1)) for a, b in spans]
    distance = np.linalg.norm(center_3 - camera.center)
    return float(2 * distance * np.linalg.norm(np.tan(np.divide(angles_2, 2))))


def view_axes(rig: StereoRig, center_3: NDArray[np.float64]) -> NDArray[np.float64]:
    """+X, +Y and +Z of a cube at a point, as rows, in the frame of the cameras.

    Raises:
        UserError: if left and right are swapped.
    """
    z_3 = (rig.left.center + rig.right.center) / 2 - center_3
    z_3 /= np.linalg.norm(z_3)
    x_3 = rig.right.center - rig.left.center
    x_3 = x_3 - (x_3 @ z_3) * z_3
    x_3 /= np.linalg.norm(x_3)
    y_3 = np.cross(z_3, x_3)
    if y_3 @ (rig.left.camera_from_rig[1, :3] + rig.right.camera_from_rig[1, :3]) > 0:
        raise UserError("rig: the left camera is right of the right one, or both are upside down; swap them")
    return np.stack([x_3, y_3, z_3])


def _crops(boxes: tuple[Box, Box], side: int, margin: float) -> tuple[Crop, Crop]:
    top, bottom = min(box.top for box in boxes), max(box.bottom for box in boxes)
    extent = margin * max(bottom - top, *(box.right - box.left for box in boxes))
    left, right = (
        Crop(box.center[0] - extent / 2, (top + bottom - extent) / 2, extent, side) for box in boxes
    )
    return left, right


def _cut(
    rig: StereoRig, crops: tuple[Crop, Crop], cube_from_source: NDArray[np.float64], unit: float
) -> StereoRig:
    left, right = (
        Camera(crop.intrinsics(camera.K), _extrinsics(camera, cube_from_source, unit), crop.side, crop.side)
        for camera, crop in zip(rig.cameras, crops, strict=True)
    )
    return StereoRig(left, right)


def _extrinsics(camera: Camera, cube_from_source: NDArray[np.float64], unit: float) -> NDArray[np.float64]:
    camera_from_cube = camera.camera_from_rig @ np.linalg.inv(cube_from_source)
    camera_from_cube[:3] /= unit
    return np.asarray(camera_from_cube)
