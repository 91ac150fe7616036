"""Which disparities a calibrated rig can show."""

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig


def disparities(points_N3: NDArray[np.float64], rig: StereoRig) -> NDArray[np.float64]:
    """``u_left - u_right`` in pixels, ``(N,)``, of rig-frame points in front of both cameras.

    Raises:
        UserError: if a point is not in front of both cameras.
    """
    (left_N2, left_depth_N), (right_N2, right_depth_N) = (camera.project(points_N3) for camera in rig.cameras)
    nearest = min(left_depth_N.min(), right_depth_N.min())
    if nearest <= 0:
        raise UserError(
            "rig: its cameras must lie outside the working volume, but a point of it has depth "
            f"{nearest:.3g} m; increase rig.distance"
        )
    return left_N2[:, 0] - right_N2[:, 0]


def disparity_range(rig: StereoRig, radius: float) -> tuple[float, float]:
    """Least and greatest disparity, pixels, over the ball of ``radius`` metres about the fixation point.

    Both are reached on the ball's surface, for disparity is monotonic along each line of sight. Sampled every
    2 degrees about +Z, poles included.
    """
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, 91), np.linspace(0, 2 * np.pi, 180, endpoint=False))
    directions_N3 = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    pixels_N = disparities(radius * directions_N3, rig)
    return float(pixels_N.min()), float(pixels_N.max())
