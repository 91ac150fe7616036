"""Row-aligned pictures of a calibrated pair, with OpenCV; pixel centres are those of :mod:`stereo_occ.geometry`.

A toed-in pair is turned until both cameras look the same way, at a right angle to the baseline. What they fixate then
lies off the middle of both pictures, so each gets a principal point of its own, that brings the working cube's centre
back to the middle: its disparity is 0 again, and disparities run from negative, behind it, to positive, in front.
"""

from dataclasses import dataclass
from itertools import product
from math import ceil, floor

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_occ.geometry.camera import Camera, StereoRig

#: OpenCV looks for a multiple of so many disparities.
MULTIPLE = 16

#: Corners of a grid over the working cube, which disparities must cover.
_GRID = np.array(list(product(np.linspace(-0.5, 0.5, 9), repeat=3)))


@dataclass(frozen=True, eq=False)
class RectifiedPair:
    """Cameras with a common orientation, focal length and rows, and the pair they were made from.

    Attributes:
        disparities: lowest and highest whole disparity to look for, pixels: all of the working cube as far as both
            cameras see it, in a number that OpenCV takes.
    """

    rig: StereoRig
    source: StereoRig
    disparities: tuple[int, int]

    def warp(self, images_2HWC: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
        """The left and the right image (of any channels) as the rectified cameras see them; 0 beyond the given ones."""
        return [
            _warp(image, source, target)
            for image, source, target in zip(images_2HWC, self.source.cameras, self.rig.cameras, strict=True)
        ]

    def depth(self, disparity_HW: NDArray[np.floating]) -> NDArray[np.float64]:
        """Depth along the left rectified axis, metres; infinite where the disparity is that of no point in front."""
        left, right = self.rig.cameras
        parallax_HW = disparity_HW - (left.K[0, 2] - right.K[0, 2])
        with np.errstate(divide="ignore"):
            depth_HW = left.K[0, 0] * self.rig.baseline / parallax_HW
        return np.where(parallax_HW > 0, depth_HW, np.inf)


def rectify(rig: StereoRig, enlarge: int) -> RectifiedPair:
    """Rectify a pair whose right camera is to the right of the left one.

    Args:
        enlarge: pixels of the rectified images per pixel of the given ones, along each side.
    """
    left, right = rig.cameras
    right_from_left = np.asarray(right.camera_from_rig @ np.linalg.inv(left.camera_from_rig), np.float64)
    no_distortion = np.zeros(5)
    turns = cv2.stereoRectify(
        left.K,
        no_distortion,
        right.K,
        no_distortion,
        (left.width, left.height),
        right_from_left[:3, :3],
        right_from_left[:3, 3:],
    )[:2]
    focal = enlarge * float(np.mean([camera.K[[0, 1], [0, 1]] for camera in rig.cameras]))
    turned = [
        _turned(camera, np.asarray(turn_33, np.float64), focal)
        for camera, turn_33 in zip(rig.cameras, turns, strict=True)
    ]
    middle_22 = np.stack([camera.project(np.zeros((1, 3)))[0][0] for camera in turned])
    middle_22[:, 1] = middle_22[:, 1].mean()  # the same rows in both
    reach_2 = np.max(
        [
            np.abs(_corners(source, target) - middle_2).max(axis=0)
            for source, target, middle_2 in zip(rig.cameras, turned, middle_22, strict=True)
        ],
        axis=0,
    )
    low, high = _disparities(rig, turned, middle_22)
    margin = max(
        abs(low), abs(high)
    )  # OpenCV gives nothing for a column whose match may lie beyond the image
    width, height = ceil(2 * (reach_2[0] + margin)), ceil(2 * reach_2[1])
    cameras = []
    for camera, middle_2 in zip(turned, middle_22, strict=True):
        K = camera.K.copy()
        K[:2, 2] += [(width - 1) / 2, (height - 1) / 2] - middle_2
        cameras.append(Camera(K, camera.camera_from_rig, width, height))
    return RectifiedPair(StereoRig(*cameras), rig, (low, high))


def _turned(camera: Camera, turn_33: NDArray[np.float64], focal: float) -> Camera:
    """A camera turned on the spot, its principal point at (0, 0)."""
    turn_44 = np.eye(4)
    turn_44[:3, :3] = turn_33
    return Camera(np.diag([focal, focal, 1.0]), turn_44 @ camera.camera_from_rig, camera.width, camera.height)


def _corners(source: Camera, target: Camera) -> NDArray[np.float64]:
    """Pixels ``(4, 2)`` of ``target`` that show the corners of the image of ``source``."""
    pixels_42 = np.array(list(product((-0.5, source.width - 0.5), (-0.5, source.height - 0.5))))
    return target.project(source.unproject(pixels_42, np.ones(4)))[0]


def _disparities(rig: StereoRig, turned: list[Camera], middle_22: NDArray[np.float64]) -> tuple[int, int]:
    seen_N = np.ones(len(_GRID), bool)
    for camera in rig.cameras:
        pixels_N2, depth_N = camera.project(_GRID)
        inside_N2 = (pixels_N2 > -0.5) & (pixels_N2 < [camera.width - 0.5, camera.height - 0.5])
        seen_N &= (depth_N > 0) & inside_N2.all(axis=1)
    points_N3 = _GRID[seen_N]
    u_left_N, u_right_N = (camera.project(points_N3)[0][:, 0] for camera in turned)
    disparity_N = (u_left_N - middle_22[0, 0]) - (u_right_N - middle_22[1, 0])
    low, high = floor(disparity_N.min()), ceil(disparity_N.max())
    return low, low + ceil((high - low + 1) / MULTIPLE) * MULTIPLE - 1


def _warp(image_HWC: NDArray[np.uint8], source: Camera, target: Camera) -> NDArray[np.uint8]:
    turn_33 = target.camera_from_rig[:3, :3] @ source.camera_from_rig[:3, :3].T
    size = (target.width, target.height)
    maps = cv2.initUndistortRectifyMap(source.K, None, turn_33, target.K, size, cv2.CV_32FC1)
    return np.asarray(cv2.remap(image_HWC, *maps, cv2.INTER_LINEAR), np.uint8)
