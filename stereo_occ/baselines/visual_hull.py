"""The two-view visual hull: all that projects into both masks (Laurentini 1994)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from stereo_occ.baselines.base import Baseline, Field
from stereo_occ.geometry.camera import project
from stereo_occ.predictors import ObjectView


class VisualHull(Baseline):
    """The largest solid that the true masks of both views allow.

    Its probability is the lower of both coverages, interpolated between pixels: 1/2 on the outlines.
    """

    def look(self, view: ObjectView) -> Field:
        """The hull of one view."""
        return hull(view)


def hull(view: ObjectView) -> Field:
    """The lower of both coverages at the pixels that points project to; 0 outside of an image."""
    coverage_2HW = view.shard.mask(view.view) / 255
    K_233, camera_from_rig_244 = view.shard.cameras(view.view)

    def field(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        lower_N = np.ones(len(points_N3))
        for coverage_HW, K_33, camera_44 in zip(coverage_2HW, K_233, camera_from_rig_244, strict=True):
            pixels_N2, depth_N = project(points_N3, K_33, camera_44)
            seen_N = map_coordinates(coverage_HW, pixels_N2.T[::-1], order=1, mode="constant", cval=0.0)
            lower_N = np.minimum(lower_N, np.where(depth_N > 0, seen_N, 0.0))
        return lower_N

    return field
