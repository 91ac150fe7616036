"""Augmentation: the picture, the camera and the points of a turned or mirrored world belong together."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from rigs import HEIGHT, WIDTH, random_pairs

from stereo_occ.data.augmentation import (
    AugmentationConfig,
    augmented,
    blurred,
    mirrored,
    photographed,
    rolled,
)
from stereo_occ.data.batch import Batch, ImageTruth, Queries, ViewId
from stereo_occ.geometry.camera import project, toed_in_rig
from stereo_occ.models.base import StereoViews

FULL = AugmentationConfig(brightness=0.2, contrast=0.2, noise=0.02, blur=0.75, mirror=0.5, roll_deg=10)


def batch_of(count, seed=0):
    rng = torch.Generator().manual_seed(seed)
    points = 0.3 * (torch.rand(count, 40, 3, generator=rng) - 0.5)
    pairs = random_pairs(count, seed)
    images_2B2HW = torch.rand(2, count, 2, HEIGHT, WIDTH, generator=rng)
    truth = ImageTruth(*images_2B2HW, pairs.camera_from_rig_B244[..., 2, 3])
    ids = [ViewId("mug", f"m{index}", 0) for index in range(count)]
    return Batch(pairs, {"train": Queries(points, (points[..., 0] > 0).float())}, ids, truth)


def pixels_of(batch):
    """Where the query points are in both images ``(B, 2, N, 2)``, and their depths."""
    points = batch.queries["train"].points_BN3[:, None]
    return project(points, batch.views.K_B233, batch.views.camera_from_rig_B244)


def drawn(batch):
    """The batch with images, masks and depths of one blurred spot at the first query point of each view."""
    pixels_B22 = pixels_of(batch)[0][:, :, 0]
    v, u = torch.meshgrid(torch.arange(HEIGHT), torch.arange(WIDTH), indexing="ij")
    squares = (torch.stack([u, v], dim=-1) - pixels_B22[:, :, None, None]).square().sum(dim=-1)
    spots_B2HW = torch.exp(-squares / (2 * 2.0**2))
    left, right = spots_B2HW[:, :, None].expand(-1, -1, 3, -1, -1).unbind(1)
    truth = replace(batch.truth, mask_B2HW=spots_B2HW, depth_B2HW=1.0 + spots_B2HW)
    return replace(batch, views=replace(batch.views, left_BCHW=left, right_BCHW=right), truth=truth)


def spot_of(image_HW):
    """Its centre of mass (u, v)."""
    v, u = torch.meshgrid(torch.arange(HEIGHT), torch.arange(WIDTH), indexing="ij")
    return torch.stack([(image_HW * axis).sum() / image_HW.sum() for axis in (u, v)])


def assert_points_are_where_they_are_shown(batch):
    pixels_B22 = pixels_of(batch)[0][:, :, 0]
    for index in range(len(batch)):
        for view, image in enumerate((batch.views.left_BCHW, batch.views.right_BCHW)):
            torch.testing.assert_close(spot_of(image[index, 0]), pixels_B22[index, view], atol=0.05, rtol=0)
            torch.testing.assert_close(image[index, 0], batch.truth.mask_B2HW[index, view])


TURNS = {
    "mirrored": lambda batch: mirrored(batch, torch.tensor([True, False, True, True])),
    "rolled": lambda batch: rolled(batch, torch.tensor([0.3, -0.5, 0.0, 0.1])),
    "both": lambda batch: rolled(mirrored(batch, torch.ones(4).bool()), torch.full((4,), 0.4)),
}


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_points_are_where_the_images_show_them(turn):
    batch = drawn(batch_of(4))
    assert_points_are_where_they_are_shown(batch)
    assert_points_are_where_they_are_shown(turn(batch))


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_pixels_that_are_no_rectangles_turn_with_the_rest(turn):
    batch = batch_of(4)
    K_B233 = batch.views.K_B233.clone()
    K_B233[..., 0, 1] = 12.0
    batch = drawn(replace(batch, views=replace(batch.views, K_B233=K_B233)))
    assert_points_are_where_they_are_shown(turn(batch))


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
def test_cameras_stay_cameras_and_labels_stay_with_their_points(turn):
    before = batch_of(4)
    after = turn(before)
    extrinsics = after.views.camera_from_rig_B244.double()
    rotations = extrinsics[..., :3, :3]
    torch.testing.assert_close(
        rotations @ rotations.mT, torch.eye(3).double().expand_as(rotations), atol=1e-5, rtol=0
    )
    assert torch.linalg.det(rotations).min() > 0.999
    assert torch.equal(extrinsics[..., 3, :], torch.tensor([0.0, 0, 0, 1]).double().expand(4, 2, 4))
    assert torch.equal(after.queries["train"].occupied_BN, before.queries["train"].occupied_BN)
    distances = [batch.queries["train"].points_BN3.norm(dim=-1) for batch in (before, after)]
    torch.testing.assert_close(*distances)
    assert after.ids == before.ids
    torch.testing.assert_close(after.truth.origin_B2, after.views.camera_from_rig_B244[..., 2, 3])


def test_depths_along_the_axes_are_kept():
    before = batch_of(4)
    depths = pixels_of(before)[1]
    torch.testing.assert_close(pixels_of(mirrored(before, torch.ones(4).bool()))[1], depths.flip(1))
    torch.testing.assert_close(pixels_of(rolled(before, torch.full((4,), 0.3)))[1], depths)


def test_a_mirrored_symmetric_rig_is_itself_with_left_on_the_left():
    rig = toed_in_rig(1.0, np.pi / 16, np.pi / 3, 64)
    K, extrinsics = (
        torch.tensor(np.stack([getattr(camera, name) for camera in rig.cameras])).float()[None]
        for name in ("K", "camera_from_rig")
    )
    images = torch.rand(2, 1, 3, 64, 64)
    batch = Batch(StereoViews(*images, K, extrinsics), {}, [ViewId("mug", "m", 0)])
    views = mirrored(batch, torch.tensor([True])).views
    torch.testing.assert_close(views.K_B233, K)
    torch.testing.assert_close(views.camera_from_rig_B244, extrinsics)
    assert torch.equal(views.left_BCHW, images[1].flip(-1))


def test_a_mirror_twice_and_no_roll_change_nothing():
    batch = batch_of(3)
    twice = mirrored(mirrored(batch, torch.ones(3).bool()), torch.ones(3).bool())
    level = rolled(batch, torch.zeros(3))
    for other in (twice, level):
        for name, value in vars(batch.views).items():
            torch.testing.assert_close(vars(other.views)[name], value, atol=1e-4, rtol=0)
        torch.testing.assert_close(other.truth.mask_B2HW, batch.truth.mask_B2HW, atol=1e-4, rtol=0)
        torch.testing.assert_close(other.queries["train"].points_BN3, batch.queries["train"].points_BN3)


def test_a_quarter_turn_is_that_of_the_pixels():
    batch = batch_of(1)
    K = torch.tensor([[50.0, 0, 31.5], [0, 50.0, 23.5], [0, 0, 1]]).repeat(1, 2, 1, 1)
    square = replace(
        batch,
        views=replace(
            batch.views,
            left_BCHW=batch.views.left_BCHW[..., 8:56],
            right_BCHW=batch.views.right_BCHW[..., 8:56],
            K_B233=K - torch.tensor([[0, 0, 8.0], [0, 0, 0], [0, 0, 0]]),
        ),
        truth=None,
    )
    turned = rolled(square, torch.tensor([np.pi / 2]).float())
    torch.testing.assert_close(
        turned.views.left_BCHW, square.views.left_BCHW.rot90(-1, (2, 3)), atol=1e-4, rtol=0
    )
    assert turned.truth is None


def test_photographs_follow_their_settings():
    images = torch.full((6, 2, 3, 8, 8), 0.5)
    images[..., :4] = 0.3
    rng = np.random.default_rng(0)
    assert torch.equal(photographed(AugmentationConfig(), images, rng), images)
    bright = photographed(AugmentationConfig(brightness=0.2), images, rng)
    factors = (bright / images).flatten(1)
    torch.testing.assert_close(factors, factors[:, :1].expand_as(factors))
    assert 0.8 <= factors.min() < 0.95 < 1.05 < factors.max() <= 1.2
    flat = photographed(AugmentationConfig(contrast=0.5), images, rng)
    torch.testing.assert_close(flat.mean(dim=(1, 2, 3, 4)), torch.full((6,), 0.4))
    spread = flat[..., -1] - flat[..., 0]
    assert 0.1 <= spread.min() < 0.17 < 0.23 < spread.max() <= 0.3
    noisy = photographed(AugmentationConfig(noise=0.1), images, rng) - images
    deviations = noisy.flatten(1).std(dim=1)
    assert deviations.max() < 0.11
    assert deviations.std() > 0.01
    assert (noisy[:, 0] - noisy[:, 1]).abs().max() > 0.02
    extreme = photographed(replace(FULL, brightness=1.0, noise=0.5), images, rng)
    assert (extreme.min(), extreme.max()) == (0, 1)


def test_blur_is_gaussian_and_each_image_has_its_own():
    images = torch.zeros(3, 2, 21, 21)
    images[..., 10, 10] = 1
    soft = blurred(images, torch.tensor([0.0, 1.0, 2.0]), radius=8)
    assert torch.equal(soft[0], images[0])
    torch.testing.assert_close(soft.sum(dim=(2, 3)), torch.ones(3, 2))
    offsets = (torch.arange(21) - 10).float()
    for sigma in (1, 2):
        profile = soft[sigma, 0].sum(dim=0)
        torch.testing.assert_close(
            (profile * offsets.square()).sum().sqrt(), torch.tensor(float(sigma)), rtol=0.01, atol=0
        )
        torch.testing.assert_close(profile, soft[sigma, 0].sum(dim=1))
    constant = torch.full((1, 3, 8, 8), 0.7)
    torch.testing.assert_close(blurred(constant, torch.tensor([1.5]), 4), constant)


def test_augmentation_depends_on_the_random_numbers_alone():
    batch = batch_of(4)
    first, again, other = (augmented(FULL, batch, np.random.default_rng(seed)) for seed in (0, 0, 1))
    for name, value in vars(first.views).items():
        assert torch.equal(value, vars(again.views)[name])
    assert not torch.equal(first.views.left_BCHW, other.views.left_BCHW)
    assert augmented(AugmentationConfig(), batch, np.random.default_rng(0)) is batch


def test_the_share_of_mirrored_pairs():
    batch = batch_of(60)
    after = augmented(AugmentationConfig(mirror=0.25), batch, np.random.default_rng(0))
    flipped = (after.queries["train"].points_BN3 != batch.queries["train"].points_BN3).any(dim=(1, 2))
    assert 5 <= int(flipped.sum()) <= 25
