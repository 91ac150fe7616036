"""The visual hull, carved by what semi-global matching (Hirschmueller 2008, as OpenCV has it) says of depth."""

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_occ.baselines.base import Baseline, Field
from stereo_occ.baselines.config import SemiGlobalMatchingConfig
from stereo_occ.baselines.rectification import RectifiedPair, rectify
from stereo_occ.baselines.visual_hull import hull
from stereo_occ.geometry.camera import Camera
from stereo_occ.predictors import ObjectView

#: Half the depth, metres, over which the probability rises from 0 to 1 at a matched surface.
_SOFTNESS = 0.01


class SemiGlobalMatching(Baseline):
    """A point is occupied if both masks allow it and no surface was matched behind it.

    Where nothing was matched, or the match lies outside the hull, the hull decides alone.
    """

    def __init__(self, config: SemiGlobalMatchingConfig) -> None:
        self.config = config

    def look(self, view: ObjectView) -> Field:
        """The carved hull of one view."""
        allowed = hull(view)
        mask_2HW = view.shard.mask(view.view) >= 128
        rgb_2HWC = np.where(mask_2HW[..., None], view.shard.rgb(view.view), 0).astype(np.uint8)
        pair = rectify(view.rig, self.config.enlarge)
        left = pair.rig.left
        depth_HW = match(pair, rgb_2HWC, self.config)
        depth_HW[~_within(allowed, left, depth_HW)] = -np.inf

        def field(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
            pixels_N2, depth_N = left.project(points_N3)
            column_N, row_N = np.rint(pixels_N2).astype(np.intp).T
            shown_N = (column_N >= 0) & (column_N < left.width) & (row_N >= 0) & (row_N < left.height)
            surface_N = np.full(len(points_N3), -np.inf)
            surface_N[shown_N] = depth_HW[row_N[shown_N], column_N[shown_N]]
            behind_N = np.clip(0.5 + (depth_N - surface_N + self.config.allowance) / (2 * _SOFTNESS), 0, 1)
            return np.asarray(np.minimum(allowed(points_N3), behind_N))

        return field


def match(
    pair: RectifiedPair, rgb_2HWC: NDArray[np.uint8], config: SemiGlobalMatchingConfig
) -> NDArray[np.float64]:
    """Depth along the axis of the left rectified camera ``(H, W)``, metres; infinite where nothing was matched."""
    low, high = pair.disparities
    penalty = config.smoothness * rgb_2HWC.shape[-1] * config.block**2
    matcher = cv2.StereoSGBM.create(
        minDisparity=low,
        numDisparities=high - low + 1,
        blockSize=config.block,
        P1=round(8 * penalty),
        P2=round(32 * penalty),
        disp12MaxDiff=1,
        uniquenessRatio=config.uniqueness,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    disparity_HW = np.asarray(matcher.compute(*pair.warp(rgb_2HWC)), np.float64) / 16  # fixed point
    return np.where(disparity_HW >= low, pair.depth(disparity_HW), np.inf)


def _within(allowed: Field, camera: Camera, depth_HW: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the point at a pixel's depth is one that the hull allows."""
    within_HW = np.isfinite(depth_HW)
    pixels_N2 = np.argwhere(within_HW)[:, ::-1].astype(np.float64)
    within_HW[within_HW] = allowed(camera.unproject(pixels_N2, depth_HW[within_HW])) >= 0.5
    return within_HW
