"""Projection into feature maps, sampling of maps and volumes, lines of sight."""

import numpy as np
import pytest
import torch
from rigs import HEIGHT, WIDTH, cameras_VB, random_rig
from torch.nn.functional import avg_pool2d

from stereo_occ.geometry.camera import toed_in_rig, transform_points
from stereo_occ.models.sampling import (
    cell_centers,
    cell_rays,
    project_points,
    ray_maps,
    sample_maps,
    sample_volume,
)


@pytest.fixture
def rigs():
    rng = np.random.default_rng(0)
    return [random_rig(rng) for _ in range(6)]


def projected(rigs, points_BN3):
    return project_points(torch.as_tensor(points_BN3).float(), *cameras_VB(rigs), WIDTH, HEIGHT)


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_a_map_of_pixel_coordinates_gives_the_pixels_that_points_project_to(rigs, stride):
    v, u = torch.meshgrid(torch.arange(HEIGHT), torch.arange(WIDTH), indexing="ij")
    coordinates_VBCHW = avg_pool2d(torch.stack([u, v]).float(), stride).expand(2, len(rigs), -1, -1, -1)
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (len(rigs), 400, 3))
    sampled = sample_maps(coordinates_VBCHW, projected(rigs, points).positions_VBN2).mT.double().numpy()
    checked = 0
    for index, rig in enumerate(rigs):
        for view, camera in enumerate(rig.cameras):
            pixels, _ = camera.project(points[index])
            first, last = (stride - 1) / 2, [WIDTH - (stride + 1) / 2, HEIGHT - (stride + 1) / 2]
            interpolated = ((pixels >= first) & (pixels <= last)).all(axis=1)
            np.testing.assert_allclose(
                sampled[view, index, interpolated], pixels[interpolated], atol=1e-4 * WIDTH
            )
            checked += interpolated.sum()
    assert checked > 2000


def test_points_are_visible_in_front_of_the_camera_and_inside_the_image(rigs):
    points = np.random.default_rng(2).uniform(-2, 2, (len(rigs), 500, 3))
    visible = projected(rigs, points).visible_VBN.bool().numpy()
    for index, rig in enumerate(rigs):
        for view, camera in enumerate(rig.cameras):
            pixels, depths = camera.project(points[index])
            inside = ((pixels >= -0.5) & (pixels <= [WIDTH - 0.5, HEIGHT - 0.5])).all(axis=1)
            np.testing.assert_array_equal(visible[view, index], inside & (depths >= 0.05))
    assert 0.05 < visible.mean() < 0.6


def test_what_is_behind_a_camera_or_at_its_centre_is_not_seen_and_harmless():
    rig = toed_in_rig(1.0, 0.2, 1.0, WIDTH)
    points = np.stack([rig.left.center, 1.5 * rig.left.center, rig.left.center * 0.99])[None]
    seen = projected([rig], points)
    assert not seen.visible_VBN[0].any()
    samples = sample_maps(torch.rand(2, 1, 3, 8, 8), seen.positions_VBN2)
    assert samples.isfinite().all()
    assert (seen.depths_VBN > 0).all()


def test_offsets_and_depths_are_those_of_the_cameras_frames(rigs):
    points = np.random.default_rng(3).uniform(-0.5, 0.5, (len(rigs), 50, 3))
    seen = projected(rigs, points)
    for index, rig in enumerate(rigs):
        for view, camera in enumerate(rig.cameras):
            local = transform_points(points[index], camera.camera_from_rig)
            fixation = camera.camera_from_rig[:3, 3]
            np.testing.assert_allclose(seen.offsets_VBN3[view, index], local - fixation, atol=1e-5)
            np.testing.assert_allclose(seen.depths_VBN[view, index], local[:, 2], atol=1e-5)


def test_projection_is_as_exact_under_autocast(rigs):
    points = torch.rand(len(rigs), 50, 3) - 0.5
    expected = projected(rigs, points).positions_VBN2
    with torch.autocast("cpu", torch.bfloat16):
        half = project_points(points, *cameras_VB(rigs), WIDTH, HEIGHT).positions_VBN2
    assert torch.equal(half, expected)


def test_a_volume_of_its_cells_centres_gives_back_points():
    cells = 8
    volume = cell_centers(cells).mT.reshape(1, 3, cells, cells, cells).expand(2, -1, -1, -1, -1)
    points = (torch.rand(2, 200, 3) - 0.5) * (1 - 1 / cells)
    torch.testing.assert_close(sample_volume(volume, points).mT, points)
    outside = sample_volume(volume, torch.tensor([[[0.5, -0.5, 0.6]]]).expand(2, -1, -1))
    torch.testing.assert_close(outside[0, :, 0], torch.tensor([0.5, -0.5, 0.5]) * (1 - 1 / cells))


@pytest.mark.parametrize("stride", [1, 4])
def test_lines_of_sight_pass_through_their_cells_and_their_camera(rigs, stride):
    height, width = HEIGHT // stride, WIDTH // stride
    centers, steps = cell_rays(*cameras_VB(rigs), height, width, stride)
    rays = ray_maps(centers, steps).double().numpy()
    v, u = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    cell_centers_in_pixels = stride * np.stack([u, v], axis=-1).reshape(-1, 2) + (stride - 1) / 2
    for index, rig in enumerate(rigs):
        for view, camera in enumerate(rig.cameras):
            directions, moments = rays[view, index].reshape(2, 3, -1).transpose(0, 2, 1)
            np.testing.assert_allclose(centers[view, index, 0], camera.center, atol=1e-6)
            pixels, depths = camera.project(camera.center + 0.7 * steps[view, index].double().numpy())
            np.testing.assert_allclose(pixels, cell_centers_in_pixels, atol=1e-3)
            np.testing.assert_allclose(depths, 0.7, atol=1e-6)
            pixels, depths = camera.project(camera.center + 0.7 * directions)
            np.testing.assert_allclose(pixels, cell_centers_in_pixels, atol=1e-3)
            assert (depths > 0).all()
            np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
            np.testing.assert_allclose(moments, np.cross(camera.center, directions), atol=1e-5)
