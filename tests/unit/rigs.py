"""Stereo rigs of no particular order, and pairs seen by them."""

import numpy as np
import torch

from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.models.base import StereoViews

WIDTH, HEIGHT = 64, 48  # pixels


def random_rig(rng):
    """Two unlike cameras 1 m or so from the origin, some 0.3 to 0.6 m apart, rolled, aimed past the origin."""
    side = rng.choice([-1, 1])
    return StereoRig(*(_random_camera(rng, angle) for angle in (-side * 0.2, side * 0.2)))


def _random_camera(rng, angle):
    azimuth, elevation = angle + rng.uniform(-0.05, 0.05), rng.uniform(-0.3, 0.3)
    back = np.array(
        [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
    )
    center = rng.uniform(0.9, 1.3) * back
    forward = rng.uniform(-0.05, 0.05, 3) - center
    forward /= np.linalg.norm(forward)
    down = rng.uniform(-0.3, 0.3, 3) - [0, 1, 0]
    right = np.cross(down, forward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    matrix[:3, 3] = -matrix[:3, :3] @ center
    focal = rng.uniform(45, 60, 2)
    principal = np.array([WIDTH - 1, HEIGHT - 1]) / 2 + rng.uniform(-3, 3, 2)
    K = np.array([[focal[0], 0, principal[0]], [0, focal[1], principal[1]], [0, 0, 1]])
    return Camera(K, matrix, WIDTH, HEIGHT)


def cameras_VB(rigs):
    """Intrinsics ``(2, B, 3, 3)`` and extrinsics ``(2, B, 4, 4)`` as float32 tensors."""
    K = [[getattr(rig, view).K for rig in rigs] for view in ("left", "right")]
    extrinsics = [[getattr(rig, view).camera_from_rig for rig in rigs] for view in ("left", "right")]
    return torch.tensor(np.array(K)).float(), torch.tensor(np.array(extrinsics)).float()


def random_pairs(batch, seed=0):
    """Noise images, each pair with a rig of its own."""
    rng = np.random.default_rng(seed)
    K_VB33, extrinsics_VB44 = cameras_VB([random_rig(rng) for _ in range(batch)])
    left, right = torch.tensor(rng.random((2, batch, 3, HEIGHT, WIDTH))).float()
    return StereoViews(left, right, K_VB33.transpose(0, 1), extrinsics_VB44.transpose(0, 1))


def swapped(views):
    """The right view first."""
    return StereoViews(
        views.right_BCHW, views.left_BCHW, views.K_B233.flip(1), views.camera_from_rig_B244.flip(1)
    )
