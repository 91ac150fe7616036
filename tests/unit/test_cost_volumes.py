"""Cost volumes and the disparities a rig can show."""

from math import pi, sin, tan

import numpy as np
import pytest
import torch
from rigs import HEIGHT as ROWS
from rigs import WIDTH as COLUMNS
from rigs import cameras_VB, random_pairs, random_rig

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.models.base import StereoViews
from stereo_occ.models.cost_volumes import (
    Concat,
    Correlation,
    Groupwise,
    PlaneSweep,
    calibrated,
    one_sided,
    shift,
    sweep_points,
)
from stereo_occ.models.disparity import disparities, disparity_range

SIGNED = range(-3, 4)
VIEWS = random_pairs(2)  # the volumes over disparities do not look at them
WIDTH = 12
HALF_ANGLE = pi / 16


def paper_rig(side):
    return toed_in_rig(distance=1.0, half_angle=HALF_ANGLE, fov=pi / 3, side=side)


def matching_features(disparity):
    """Left and right features of unit length with ``left[u] == right[u - disparity]`` wherever both exist."""
    generator = torch.Generator().manual_seed(0)
    strip = torch.nn.functional.normalize(torch.randn(2, 8, 5, WIDTH + 6, generator=generator), dim=1)
    return strip[..., 3 : 3 + WIDTH], strip[..., 3 + disparity : 3 + disparity + WIDTH]


def visible_columns(disparity):
    return slice(max(0, disparity), WIDTH + min(0, disparity))


@pytest.mark.parametrize("disparity", SIGNED)
def test_correlation_peaks_at_the_disparity_of_the_images(disparity):
    left, right = matching_features(disparity)
    volume = Correlation(8, disparities=SIGNED)(left, right, VIEWS)
    best = torch.tensor(SIGNED)[volume.sum(dim=1).argmax(dim=1)]
    assert (best[..., visible_columns(disparity)] == disparity).all()


@pytest.mark.parametrize("disparity", [0, 2])
def test_one_sided_correlation_counts_from_zero(disparity):
    left, right = matching_features(disparity)
    best = Correlation(8, disparities=one_sided(4))(left, right, VIEWS).sum(dim=1).argmax(dim=1)
    assert (best[..., visible_columns(disparity)] == disparity).all()


def test_correlation_is_the_channelwise_product_at_one_known_cell():
    left, right = torch.randn(1, 8, 5, WIDTH), torch.randn(1, 8, 5, WIDTH)
    volume = Correlation(8, disparities=SIGNED)(left, right, VIEWS)
    assert volume.shape == (1, 8, 7, 5, WIDTH)
    torch.testing.assert_close(volume[0, :, 6, 1, 7], left[0, :, 1, 7] * right[0, :, 1, 4])  # d = 3
    torch.testing.assert_close(volume[0, :, 0, 1, 7], left[0, :, 1, 7] * right[0, :, 1, 10])  # d = -3


def test_groupwise_is_the_mean_of_neighbouring_channels_of_the_correlation():
    left, right = torch.randn(2, 8, 5, WIDTH), torch.randn(2, 8, 5, WIDTH)
    products = Correlation(8, disparities=SIGNED)(left, right, VIEWS)
    volume = Groupwise(8, disparities=SIGNED, groups=4)(left, right, VIEWS)
    torch.testing.assert_close(volume[:, 1], (products[:, 2] + products[:, 3]) / 2)
    assert volume.shape[1] == 4


@pytest.mark.parametrize("disparity", SIGNED)
def test_concat_holds_equal_halves_at_the_disparity_of_the_images(disparity):
    left, right = matching_features(disparity)
    volume = Concat(8, disparities=SIGNED)(left, right, VIEWS)
    left_half, right_half = volume[:, :8], volume[:, 8:]
    distance = (left_half - right_half).abs().sum(dim=1)
    assert (distance[:, disparity + 3] == 0).all()
    assert (distance[:, (disparity + 4) % 7][..., 3 : WIDTH - 3] > 0.1).all()
    torch.testing.assert_close(left_half[:, :, 3], left)


@pytest.mark.parametrize(
    "volume",
    [
        Correlation(8, disparities=SIGNED),
        Groupwise(8, disparities=SIGNED, groups=4),
        Concat(8, disparities=SIGNED),
    ],
    ids=lambda v: type(v).__name__,
)
def test_nothing_is_matched_outside_the_right_image(volume):
    values = volume(torch.ones(1, 8, 2, WIDTH), torch.ones(1, 8, 2, WIDTH), VIEWS)
    assert values.shape[1] == volume.out_channels
    for k, d in enumerate(SIGNED):
        inside = torch.zeros(WIDTH)
        inside[visible_columns(d)] = 1
        torch.testing.assert_close(values[0, :, k], inside.expand_as(values[0, :, k]))


def test_shift_beyond_the_image_leaves_nothing():
    assert (shift(torch.ones(1, 1, 1, 4), [4, -4, 9]) == 0).all()


@pytest.mark.parametrize(
    "volume",
    [
        Correlation(8, disparities=SIGNED),
        Groupwise(8, disparities=SIGNED, groups=2),
        PlaneSweep(8, planes=16),
    ],
    ids=lambda volume: type(volume).__name__,
)
def test_autocast_costs_volumes_no_digit(volume):
    """Features may be of half precision; where they are looked up, and their products, are not."""
    features = torch.randn(2, 8, WIDTH, WIDTH, generator=torch.Generator().manual_seed(0)).bfloat16()
    expected = volume(features, features.flip(-1), VIEWS)
    with torch.autocast("cpu", torch.bfloat16):
        found = volume(features, features.flip(-1), VIEWS)
    assert found.dtype == torch.float32
    assert torch.equal(found, expected)


def test_groups_must_divide_the_channels():
    with pytest.raises(
        UserError, match=r"model\.cost_volume\.groups: must divide the encoder's 8 channels, got 3"
    ):
        Groupwise(8, disparities=SIGNED, groups=3)


def test_one_sided_volume_needs_a_cell():
    with pytest.raises(UserError, match=r"model\.cost_volume\.disparities"):
        one_sided(0)


def closed_form(z, side):
    """Disparity of (0, 0, z) in a toed-in rig at 1 m."""
    focal = side / 2 / tan(pi / 6)
    return 2 * focal * z * sin(HALF_ANGLE) / (1 - z * np.cos(HALF_ANGLE))


def test_disparity_on_the_z_axis_follows_the_closed_form():
    z = np.linspace(-0.5, 0.5, 11)
    points = np.stack([0 * z, 0 * z, z], axis=1)
    pixels = disparities(points, paper_rig(64))
    np.testing.assert_allclose(pixels, closed_form(z, 64), atol=1e-9)
    assert pixels[0] < 0 < pixels[-1]  # behind, in front


def test_range_of_the_paper_rig_is_reached_on_the_z_axis():
    np.testing.assert_allclose(
        disparity_range(paper_rig(64), 0.5), [closed_form(-0.5, 64), closed_form(0.5, 64)]
    )


@pytest.mark.parametrize("half_angle", [0.05, HALF_ANGLE, 0.6])
def test_range_holds_every_point_of_the_ball(half_angle):
    rig = toed_in_rig(distance=0.9, half_angle=half_angle, fov=1.2, side=64)
    least, greatest = disparity_range(rig, 0.5)
    points = np.random.default_rng(0).normal(size=(20000, 3))
    points *= (
        0.5
        * np.random.default_rng(1).uniform(0.9, 1, (20000, 1))
        / np.linalg.norm(points, axis=1, keepdims=True)
    )
    pixels = disparities(points, rig)
    slack = 1e-3 * (greatest - least)
    assert least - slack < pixels.min() < least + 20 * slack
    assert greatest - 50 * slack < pixels.max() < greatest + slack


@pytest.mark.parametrize(("side", "cells"), [(64, range(-2, 7)), (128, range(-4, 12)), (224, range(-7, 20))])
def test_calibrated_cells_of_the_paper_rig(side, cells):
    assert calibrated(paper_rig(side), stride=4) == cells


def test_a_camera_inside_the_working_volume_is_refused():
    rig = toed_in_rig(distance=0.4, half_angle=HALF_ANGLE, fov=1.0, side=64)
    with pytest.raises(UserError, match=r"increase rig\.distance"):
        calibrated(rig, stride=4)


def test_swept_planes_are_parallel_to_the_image_and_span_the_working_ball():
    rng = np.random.default_rng(0)
    rigs = [random_rig(rng) for _ in range(4)]
    K, extrinsics = (tensor[0] for tensor in cameras_VB(rigs))
    points = sweep_points(K, extrinsics, 5, 3, 4, stride=16).double().numpy()
    assert points.shape == (4, 5 * 3 * 4, 3)
    for rig, points_N3 in zip(rigs, points, strict=True):
        pixels, depths = rig.left.project(points_N3)
        v, u = np.meshgrid(16 * np.arange(3) + 7.5, 16 * np.arange(4) + 7.5, indexing="ij")
        np.testing.assert_allclose(pixels, np.tile(np.stack([u, v], -1).reshape(-1, 2), (5, 1)), atol=1e-3)
        inverse_DP = 1 / depths.reshape(5, -1)
        fixation = rig.left.camera_from_rig[2, 3]
        np.testing.assert_allclose(
            1 / inverse_DP[[0, -1]], [[fixation - 0.5] * 12, [fixation + 0.5] * 12], atol=1e-5
        )
        np.testing.assert_allclose(np.diff(inverse_DP, n=2, axis=0), 0, atol=1e-5)


def features_of_plane(camera, left, depth, waves, phases):
    """Waves over the plane at ``depth`` in front of ``left``, as ``camera`` sees them: ``(8, ROWS, COLUMNS)``."""
    v, u = np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij")
    rays = camera.unproject(np.stack([u, v], -1).reshape(-1, 2), np.ones(u.size)) - camera.center
    normal = left.camera_from_rig[2, :3]
    distance = depth - left.camera_from_rig[2, 3] - camera.center @ normal
    points = camera.center + rays * (distance / (rays @ normal))[:, None]
    return np.cos(points @ waves + phases).T.reshape(-1, ROWS, COLUMNS)


@pytest.mark.parametrize("plane", [1, 4, 7])
def test_plane_sweep_peaks_at_the_plane_that_both_views_see(plane):
    rng = np.random.default_rng(plane)
    waves, phases = rng.uniform(-40, 40, (3, 48)), rng.uniform(0, 2 * np.pi, 48)
    sweep, matched = PlaneSweep(48, planes=9), 0
    for _ in range(6):
        rig = random_rig(rng)
        K, extrinsics = (tensor.transpose(0, 1) for tensor in cameras_VB([rig]))
        fixation = rig.left.camera_from_rig[2, 3]
        depth = 1 / np.linspace(1 / (fixation - 0.5), 1 / (fixation + 0.5), 9)[plane]
        left, right = (
            torch.tensor(features_of_plane(camera, rig.left, depth, waves, phases))[None].float()
            for camera in rig.cameras
        )
        blank = torch.zeros(1, 3, ROWS, COLUMNS)
        volume = sweep(left, right, StereoViews(blank, blank, K, extrinsics))
        assert volume.shape == (1, 48, 9, ROWS, COLUMNS)
        seen = (volume[0] != 0).any(dim=0).all(dim=0)
        matched += int((volume[0].mean(dim=0).argmax(dim=0)[seen] == plane).sum())
        assert (volume[0].mean(dim=0).argmax(dim=0)[seen] == plane).float().mean() > 0.95
    assert matched > 500
