"""Boxes found in an image, and square parts of an image as cameras of their own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera


@dataclass(frozen=True)
class Box:
    """A rectangle of an image, its edges in pixels: the pixel (0, 0) spans -0.5 .. 0.5."""

    left: float
    top: float
    right: float
    bottom: float

    def __post_init__(self) -> None:
        if not (self.left < self.right and self.top < self.bottom):
            raise UserError(f"box: must have left < right and top < bottom, got {self}")

    @classmethod
    def around(cls, pixels_N2: NDArray[np.float64]) -> "Box":
        """The smallest box that holds the points ``(N, 2)``."""
        (left, top), (right, bottom) = pixels_N2.min(axis=0), pixels_N2.max(axis=0)
        return cls(float(left), float(top), float(right), float(bottom))

    @classmethod
    def of_mask(cls, mask_HW: NDArray[np.bool_]) -> "Box":
        """The smallest box that holds the true pixels, whole.

        Raises:
            UserError: if there is none.
        """
        rows, columns = (np.flatnonzero(mask_HW.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            raise UserError("mask: is empty, the object must be seen in both images")
        return cls(columns[0] - 0.5, rows[0] - 0.5, columns[-1] + 0.5, rows[-1] + 0.5)

    @property
    def center(self) -> tuple[float, float]:
        """Pixels ``(u, v)``."""
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2


@dataclass(frozen=True)
class Crop:
    """A square of an image, resampled to another size; it may reach beyond the image.

    Attributes:
        left, top: edges, pixels of the image.
        extent: side of the square, pixels of the image.
        side: pixels per side after resampling.
    """

    left: float
    top: float
    extent: float
    side: int

    def intrinsics(self, K_33: NDArray[np.float64]) -> NDArray[np.float64]:
        """``K`` of the crop: a pixel ``u`` of the image is ``(u - left) side / extent - 1/2`` here."""
        scale = self.side / self.extent
        crop_from_image = np.array(
            [[scale, 0, -scale * self.left - 0.5], [0, scale, -scale * self.top - 0.5], [0, 0, 1]]
        )
        return crop_from_image @ K_33

    def camera(self, camera: Camera) -> Camera:
        """The camera whose whole image is this crop of ``camera``'s."""
        return Camera(self.intrinsics(camera.K), camera.camera_from_rig, self.side, self.side)
