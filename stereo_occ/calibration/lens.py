"""What a lens does to an image: OpenCV's two models, both ways."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError

#: Lengths of OpenCV's list k1, k2, p1, p2, k3, k4, k5, k6, s1 .. s4, tau_x, tau_y.
LENGTHS = (0, 4, 5, 8, 12, 14)


@dataclass(frozen=True, eq=False)
class Lens:
    """Distortion of image coordinates: where ``x / z, y / z`` of a point appears instead.

    Attributes:
        coefficients: of OpenCV's ``calib3d`` (radial, tangential, thin prism), or of its ``fisheye`` model.
        fisheye: which of the two.

    Raises:
        UserError: on a number of coefficients that the model does not have, or a tilted sensor.
    """

    coefficients: NDArray[np.float64]
    fisheye: bool = False

    def __post_init__(self) -> None:
        lengths = (4,) if self.fisheye else LENGTHS
        if self.coefficients.ndim != 1 or len(self.coefficients) not in lengths:
            raise UserError(
                f"distortion: {'fisheye' if self.fisheye else 'plumb_bob'} takes "
                f"{' or '.join(map(str, lengths))} coefficients, got {self.coefficients.size}"
            )
        if not np.isfinite(self.coefficients).all():
            raise UserError(f"distortion: must be finite numbers, got {self.coefficients.tolist()}")
        if self.coefficients[12:].any():
            raise UserError("distortion: a tilted sensor (14 coefficients) is not supported; undistort first")

    @classmethod
    def from_list(cls, values: Sequence[float], fisheye: bool = False) -> "Lens":
        """From the list in a calibration file."""
        return cls(np.asarray(values, dtype=np.float64).ravel(), fisheye)

    @property
    def ideal(self) -> bool:
        """Whether it does nothing."""
        return not self.fisheye and not self.coefficients.any()

    def distort(self, points_N2: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where ideal coordinates ``(N, 2)`` appear."""
        if self.ideal:
            return points_N2
        return self._fisheye(points_N2) if self.fisheye else self._radial(points_N2)

    def undistort(self, points_N2: NDArray[np.float64]) -> NDArray[np.float64]:
        """The ideal coordinates of what appears at ``(N, 2)``: Newton's method.

        Raises:
            UserError: where there are none, far outside the images that the lens was calibrated with.
        """
        if self.ideal:
            return points_N2
        ideal_N2 = points_N2.copy()
        with suppress(np.linalg.LinAlgError):
            for _ in range(50):
                error_N2 = self.distort(ideal_N2) - points_N2
                if np.abs(error_N2).max(initial=0) < 1e-10:
                    break
                ideal_N2 = ideal_N2 - np.linalg.solve(self._slope(ideal_N2), error_N2[..., None])[..., 0]
        near = np.abs(self.distort(ideal_N2) - points_N2).max(initial=0) < 1e-6
        # Beyond the radius where the image folds back there are solutions, too, that no light takes.
        unfolded = (np.linalg.det(self._slope(ideal_N2)) > 0) & ((ideal_N2 * points_N2).sum(axis=1) >= 0)
        if near and unfolded.all():
            return ideal_N2
        raise UserError(
            "distortion: cannot be removed where the object is; are the coefficients in OpenCV's order "
            "(k1, k2, p1, p2, k3)?"
        )

    def _slope(self, points_N2: NDArray[np.float64], step: float = 1e-6) -> NDArray[np.float64]:
        """Derivatives ``(N, 2, 2)`` of what :meth:`distort` gives."""
        columns = [
            (self.distort(points_N2 + shift_2) - self.distort(points_N2 - shift_2)) / (2 * step)
            for shift_2 in step * np.eye(2)
        ]
        return np.stack(columns, axis=-1)

    def _radial(self, points_N2: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = np.pad(self.coefficients, (0, 12))[:12]
        x, y = points_N2.T
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4),
            ],
            axis=-1,
        )

    def _fisheye(self, points_N2: NDArray[np.float64]) -> NDArray[np.float64]:
        r = np.maximum(np.linalg.norm(points_N2, axis=1), 1e-12)
        theta = np.arctan(r)
        powers = theta[:, None] ** [2, 4, 6, 8]
        scale = theta * (1 + powers @ self.coefficients) / r
        return np.asarray(points_N2 * scale[:, None])
