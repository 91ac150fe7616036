"""Pinhole cameras and calibrated stereo rigs.

The functions take NumPy arrays or torch tensors alike, with any leading batch dimensions.
"""

from dataclasses import dataclass
from math import cos, pi, sin, tan
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from stereo_occ.errors import UserError

#: How far rotations may be from orthonormal.
RIGID_TOLERANCE = 2e-5

Array = TypeVar("Array", NDArray[np.float64], NDArray[np.float32], Tensor)


def transform_points(points_N3: Array, target_from_source_44: Array) -> Array:
    """Apply a 4x4 affine transform to row-vector points ``(..., N, 3)``."""
    moved_N3: Array = (
        points_N3 @ target_from_source_44[..., :3, :3].mT + target_from_source_44[..., None, :3, 3]
    )
    return moved_N3


def project(points_N3: Array, K_33: Array, camera_from_rig_44: Array) -> tuple[Array, Array]:
    """Project rig-frame points to pixels.

    Returns:
        Pixels ``(..., N, 2)`` and depths along the optical axis ``(..., N)`` in metres. Points at or behind the
        optical centre have depth <= 0 and meaningless pixels.
    """
    camera_N3 = transform_points(points_N3, camera_from_rig_44)
    homogeneous_N3 = camera_N3 @ K_33.mT
    return homogeneous_N3[..., :2] / homogeneous_N3[..., 2:], camera_N3[..., 2]


def normalize_pixels(pixels_N2: Tensor, width: int, height: int) -> Tensor:
    """Pixels to the [-1, 1] coordinates of ``grid_sample(align_corners=False)``.

    -1 and 1 are the outer edges of the image, so the same coordinates address feature maps of any stride.
    """
    return (2 * pixels_N2 + 1) / pixels_N2.new_tensor([width, height]) - 1


def resized_intrinsics(
    K_33: NDArray[np.float64], size: tuple[int, int], target: tuple[int, int]
) -> NDArray[np.float64]:
    """``K`` of an image of that width and height when it is resampled to another: it spans -0.5 .. size - 0.5."""
    scale_2 = np.array(target) / size
    K_33 = K_33.copy()
    K_33[:2] *= scale_2[:, None]
    K_33[:2, 2] += (scale_2 - 1) / 2
    return K_33


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera: intrinsics ``K`` (3x3, pixels), ``camera_from_rig`` (4x4, metres), image size in pixels."""

    K: NDArray[np.float64]
    camera_from_rig: NDArray[np.float64]
    width: int
    height: int

    def __post_init__(self) -> None:
        check_rigid(self.camera_from_rig, "camera_from_rig")
        if not (self.K[0, 0] > 0 and self.K[1, 1] > 0 and np.isfinite(self.K).all()):
            raise UserError(f"K: focal lengths must be positive and finite, got {self.K.tolist()}")

    def resized(self, width: int, height: int) -> "Camera":
        """The camera of the same image at another size."""
        return Camera(
            resized_intrinsics(self.K, (self.width, self.height), (width, height)),
            self.camera_from_rig,
            width,
            height,
        )

    def project(self, points_N3: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rig-frame points ``(N, 3)`` to pixels ``(N, 2)`` and depths ``(N,)``; see :func:`project`."""
        return project(points_N3, self.K, self.camera_from_rig)

    def unproject(self, pixels_N2: NDArray[np.float64], depth_N: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels ``(N, 2)`` at depths ``(N,)`` metres to rig-frame points ``(N, 3)``; inverse of :meth:`project`."""
        homogeneous_N3 = np.concatenate([pixels_N2, np.ones_like(pixels_N2[..., :1])], axis=-1)
        camera_N3: NDArray[np.float64] = homogeneous_N3 @ np.linalg.inv(self.K).T * depth_N[..., None]
        return transform_points(camera_N3, np.linalg.inv(self.camera_from_rig).astype(np.float64))

    @property
    def center(self) -> NDArray[np.float64]:
        """Optical centre in the rig frame, ``(3,)`` metres."""
        rotation, translation = self.camera_from_rig[:3, :3], self.camera_from_rig[:3, 3]
        return -rotation.T @ translation

    def clearance(self, point_3: NDArray[np.float64]) -> float:
        """Distance in metres from a rig-frame point to the nearest side of the view; negative outside it."""
        left, top, right, bottom = -0.5, -0.5, self.width - 0.5, self.height - 0.5
        # The plane through the optical centre and the pixel line a u + b v + c = 0 has the normal K^T (a, b, c).
        lines_43 = np.array([[1, 0, -left], [0, 1, -top], [-1, 0, right], [0, -1, bottom]])
        normals_43 = lines_43 @ self.K
        normals_43 /= np.linalg.norm(normals_43, axis=1, keepdims=True)
        return float((normals_43 @ transform_points(point_3[None], self.camera_from_rig)[0]).min())


@dataclass(frozen=True, eq=False)
class StereoRig:
    """A left and a right camera in one rig frame."""

    left: Camera
    right: Camera

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        """Left, right."""
        return self.left, self.right

    @property
    def baseline(self) -> float:
        """Distance between the optical centres in metres."""
        return float(np.linalg.norm(self.left.center - self.right.center))


def toed_in_rig(distance: float, half_angle: float, fov: float, side: int) -> StereoRig:
    """Two cameras on a circle about the fixation point, looking at it: the paper's Figure 4.

    Args:
        distance: from each camera to the fixation point, metres (the paper: 1).
        half_angle: angle of each camera from the mid-line about +Y, radians (the paper: pi/16); left is at -half_angle.
        fov: vertical field of view, radians (pi/3).
        side: image side in pixels; images are square.
    """
    for name, value, upper in (
        ("distance", distance, np.inf),
        ("half_angle", half_angle, pi / 2),
        ("fov", fov, pi),
    ):
        if not 0 < value < upper:
            raise UserError(f"rig.{name}: must lie in (0, {upper:.4g}), got {value}")
    K = intrinsics(fov, side)
    return StereoRig(
        *(Camera(K, look_at_origin(angle, distance), side, side) for angle in (-half_angle, half_angle))
    )


def intrinsics(fov: float, side: int) -> NDArray[np.float64]:
    """Intrinsics (3x3) of a centred square camera with field of view ``fov`` radians and ``side`` pixels."""
    return centered_intrinsics(side / 2 / tan(fov / 2), side, side)


def centered_intrinsics(focal: float, width: int, height: int) -> NDArray[np.float64]:
    """Intrinsics (3x3) of square pixels whose principal point is the image's centre; all in pixels."""
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]], dtype=np.float64)


def look_at_origin(angle: float, distance: float) -> NDArray[np.float64]:
    """``camera_from_rig`` (4x4) of a camera at ``distance`` metres, ``angle`` radians from +Z about +Y, upright."""
    c, s = cos(angle), sin(angle)
    return np.array(
        [
            [c, 0, -s, 0],  # camera +X: right
            [0, -1, 0, 0],  # camera +Y: down
            [-s, 0, -c, distance],  # camera +Z: from the camera to the origin
            [0, 0, 0, 1],
        ]
    )


def check_rigid(matrix_44: NDArray[np.float64], name: str) -> None:
    """Raise :class:`UserError` unless the 4x4 matrix is a rotation and a translation, to RIGID_TOLERANCE."""
    if matrix_44.shape != (4, 4) or not np.isfinite(matrix_44).all():
        raise UserError(
            f"{name}: must be a finite 4x4 matrix, got shape {matrix_44.shape}: {matrix_44.tolist()}"
        )
    if np.abs(matrix_44[3] - [0, 0, 0, 1]).max() > RIGID_TOLERANCE:
        raise UserError(f"{name}: the last row must be [0, 0, 0, 1], got {matrix_44[3].tolist()}")
    rotation = matrix_44[:3, :3]
    error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if error > RIGID_TOLERANCE or np.linalg.det(rotation) < 0:
        raise UserError(
            f"{name}: the upper left 3x3 block must be a rotation (orthonormal, determinant +1), "
            f"got {rotation.tolist()}"
        )
