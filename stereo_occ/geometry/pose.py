"""The pose of an object in the rig."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import check_rigid


@dataclass(frozen=True, eq=False)
class Pose:
    """Where an object is: ``points_rig = scale * points_object @ rotation_33.T + center_3``.

    Attributes:
        rotation_33: object to rig, a rotation matrix.
        scale: diagonal of the object's bounding box in metres (an object frame's unit is its diagonal).
        center_3: the box's centre in the rig frame, metres.

    Raises:
        UserError: if the rotation is not one, the scale not positive or the centre not three finite numbers.
    """

    rotation_33: NDArray[np.float64]
    scale: float
    center_3: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.rotation_33.shape != (3, 3):
            raise UserError(f"pose.rotation: must be a 3x3 matrix, got shape {self.rotation_33.shape}")
        if self.center_3.shape != (3,) or not np.isfinite(self.center_3).all():
            raise UserError(f"pose.center: must be three finite metres, got {self.center_3.tolist()}")
        if not 0 < self.scale < np.inf:
            raise UserError(f"pose.scale: must be positive and finite metres, got {self.scale}")
        rigid = np.eye(4)
        rigid[:3, :3] = self.rotation_33
        check_rigid(rigid, "pose.rotation")

    @classmethod
    def from_matrix(cls, rig_from_object_44: NDArray[np.float64]) -> Self:
        """The pose of a 4x4 similarity transform; inverse of :attr:`rig_from_object`."""
        scale = float(np.cbrt(np.linalg.det(rig_from_object_44[:3, :3])))
        return cls(rig_from_object_44[:3, :3] / scale, scale, rig_from_object_44[:3, 3])

    @property
    def rig_from_object(self) -> NDArray[np.float64]:
        """The pose as a 4x4 similarity transform."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.scale * self.rotation_33
        matrix[:3, 3] = self.center_3
        return matrix

    def to_rig(self, points_N3: NDArray[np.floating]) -> NDArray[np.float64]:
        """Object-frame points ``(..., 3)`` to the rig frame, metres."""
        return self.scale * (points_N3 @ self.rotation_33.T) + self.center_3

    def to_object(self, points_N3: NDArray[np.floating]) -> NDArray[np.float64]:
        """Rig-frame points ``(..., 3)`` to the object frame; inverse of :meth:`to_rig`."""
        return (points_N3 - self.center_3) @ self.rotation_33 / self.scale
