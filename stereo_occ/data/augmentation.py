"""Augmentation of training batches, consistent: where the picture turns, its camera and its points turn with it."""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import conv2d, grid_sample, pad

from stereo_occ.data.batch import Batch, ImageTruth, Queries
from stereo_occ.geometry.camera import normalize_pixels
from stereo_occ.models.base import StereoViews


@dataclass
class AugmentationConfig:
    """What varies from batch to batch; 0 leaves it out."""

    brightness: float = 0.0  # largest change as a share, the same for both views
    contrast: float = 0.0  # likewise, about the pair's mean
    noise: float = 0.0  # largest standard deviation; images are in [0, 1]
    blur: float = 0.0  # largest standard deviation in pixels, of each view by itself
    mirror: float = 0.0  # share of pairs that are seen in a mirror
    roll_deg: float = 0.0  # largest angle of the cameras about their lines of sight, the same for both views


def augmented(config: AugmentationConfig, batch: Batch, rng: np.random.Generator) -> Batch:
    """``batch`` with random changes of all kinds that ``config`` asks for."""
    if config == AugmentationConfig():
        return batch
    if config.mirror:
        batch = mirrored(batch, torch.from_numpy(rng.random(len(batch)) < config.mirror))
    if config.roll_deg:
        angles_B = np.radians(rng.uniform(-config.roll_deg, config.roll_deg, len(batch)))
        batch = rolled(batch, torch.from_numpy(angles_B).float())
    images_B2CHW = torch.stack([batch.views.left_BCHW, batch.views.right_BCHW], dim=1)
    left_BCHW, right_BCHW = photographed(config, images_B2CHW, rng).unbind(1)
    return replace(batch, views=replace(batch.views, left_BCHW=left_BCHW, right_BCHW=right_BCHW))


#: Points of the rig frame to those of the mirrored world.
FLIP_3 = (-1.0, 1.0, 1.0)


def mirrored_views(views: StereoViews) -> StereoViews:
    """Pairs as if the world were mirrored, x to -x: the mirror image of the right view is the left one."""
    flip_44 = torch.diag(torch.tensor([*FLIP_3, 1.0]))
    K_B233 = views.K_B233.flip(1)
    K_B233[..., 0, 1] *= -1
    K_B233[..., 0, 2] = views.left_BCHW.shape[-1] - 1 - K_B233[..., 0, 2]
    extrinsics_B244 = flip_44 @ views.camera_from_rig_B244.flip(1) @ flip_44
    return StereoViews(views.right_BCHW.flip(-1), views.left_BCHW.flip(-1), K_B233, extrinsics_B244)


def mirrored(batch: Batch, chosen_B: Tensor) -> Batch:
    """The chosen pairs as :func:`mirrored_views` has them, with their points and their images' truth."""
    views, other, truth = batch.views, mirrored_views(batch.views), batch.truth
    flip_3 = torch.tensor(FLIP_3)

    def choose(mirror: Tensor, own: Tensor) -> Tensor:
        return torch.where(chosen_B.view(-1, *(1,) * (own.ndim - 1)), mirror, own)

    return replace(
        batch,
        views=replace(
            views,
            left_BCHW=choose(other.left_BCHW, views.left_BCHW),
            right_BCHW=choose(other.right_BCHW, views.right_BCHW),
            K_B233=choose(other.K_B233, views.K_B233),
            camera_from_rig_B244=choose(other.camera_from_rig_B244, views.camera_from_rig_B244),
        ),
        queries={
            name: Queries(choose(queries.points_BN3 * flip_3, queries.points_BN3), queries.occupied_BN)
            for name, queries in batch.queries.items()
        },
        truth=truth
        and ImageTruth(
            choose(truth.mask_B2HW.flip(1, 3), truth.mask_B2HW),
            choose(truth.depth_B2HW.flip(1, 3), truth.depth_B2HW),
            choose(truth.origin_B2.flip(1), truth.origin_B2),
        ),
    )


def rolled(batch: Batch, angle_B: Tensor) -> Batch:
    """Both cameras turned about their optical axes, which turns the pictures about the principal points.

    Args:
        angle_B: radians; the picture turns clockwise.
    """
    views, truth = batch.views, batch.truth
    cos_B, sin_B = angle_B.cos(), angle_B.sin()
    turn_B144 = torch.eye(4).repeat(len(batch), 1, 1, 1)
    turn_B144[:, 0, :2, :2] = torch.stack([cos_B, -sin_B, sin_B, cos_B], dim=1).view(-1, 2, 2)
    height, width = views.left_BCHW.shape[-2:]
    v_HW, u_HW = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    pixels_N2 = torch.stack([u_HW, v_HW], dim=-1).view(-1, 2).float()
    scale_B222, center_B212 = views.K_B233[..., :2, :2], views.K_B233[..., None, :2, 2]
    back_B222 = scale_B222 @ turn_B144[..., :2, :2].mT @ scale_B222.inverse()
    sources_B2N2 = (pixels_N2 - center_B212) @ back_B222.mT + center_B212
    grid_MHW2 = normalize_pixels(sources_B2N2, width, height).view(-1, height, width, 2)

    def turned(images_B2CHW: Tensor, mode: str, outside: str) -> Tensor:
        images_MCHW = images_B2CHW.flatten(0, 1)
        return grid_sample(
            images_MCHW, grid_MHW2, mode=mode, padding_mode=outside, align_corners=False
        ).view_as(images_B2CHW)

    left_BCHW, right_BCHW = turned(
        torch.stack([views.left_BCHW, views.right_BCHW], dim=1), "bilinear", "border"
    ).unbind(1)
    return replace(
        batch,
        views=replace(
            views,
            left_BCHW=left_BCHW,
            right_BCHW=right_BCHW,
            camera_from_rig_B244=turn_B144 @ views.camera_from_rig_B244,
        ),
        truth=truth
        and ImageTruth(
            turned(truth.mask_B2HW[:, :, None], "bilinear", "zeros")[:, :, 0],
            turned(truth.depth_B2HW[:, :, None], "nearest", "zeros")[:, :, 0],
            truth.origin_B2,
        ),
    )


def photographed(config: AugmentationConfig, images_B2CHW: Tensor, rng: np.random.Generator) -> Tensor:
    """Images with another contrast, brightness, focus and noise, in this order, cut to [0, 1]."""
    pairs, views = images_B2CHW.shape[:2]

    def factors(change: float) -> Tensor:
        return torch.from_numpy(rng.uniform(1 - change, 1 + change, (pairs, 1, 1, 1, 1))).float()

    if config.contrast:
        mean_B1111 = images_B2CHW.mean(dim=(1, 2, 3, 4), keepdim=True)
        images_B2CHW = torch.lerp(mean_B1111, images_B2CHW, factors(config.contrast))
    if config.brightness:
        images_B2CHW = images_B2CHW * factors(config.brightness)
    if config.blur:
        sigma_M = torch.from_numpy(rng.uniform(0, config.blur, pairs * views)).float()
        blurred_MCHW = blurred(images_B2CHW.flatten(0, 1), sigma_M, ceil(2.5 * config.blur))
        images_B2CHW = blurred_MCHW.view_as(images_B2CHW)
    if config.noise:
        generator = torch.Generator().manual_seed(int(rng.integers(2**63)))
        sigma_B1111 = torch.from_numpy(rng.uniform(0, config.noise, (pairs, 1, 1, 1, 1))).float()
        images_B2CHW = images_B2CHW + sigma_B1111 * torch.randn(images_B2CHW.shape, generator=generator)
    return images_B2CHW.clamp(0, 1)


def blurred(images_MCHW: Tensor, sigma_M: Tensor, radius: int) -> Tensor:
    """Each image with a Gaussian blur of its own, cut at ``radius`` pixels; the borders go on as they end."""
    M, C, H, W = images_MCHW.shape
    offsets_K = torch.arange(-radius, radius + 1)
    kernels_MK = torch.exp(-0.5 * (offsets_K / sigma_M.clamp(min=1e-3)[:, None]) ** 2)
    kernels_MK = kernels_MK / kernels_MK.sum(dim=1, keepdim=True)
    kernels_NK = kernels_MK.repeat_interleave(C, dim=0)
    padded_MCHW = pad(images_MCHW, (radius,) * 4, mode="replicate")
    padded_1NHW = padded_MCHW.reshape(1, M * C, H + 2 * radius, W + 2 * radius)
    rows_1NHW = conv2d(padded_1NHW, kernels_NK[:, None, None], groups=M * C)
    return conv2d(rows_1NHW, kernels_NK[:, None, :, None], groups=M * C).view(M, C, H, W)
