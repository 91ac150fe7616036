"""Frames and signs: what a user of another convention would get wrong first."""

from math import atan2, cos, degrees, pi, radians, sin

import numpy as np
import pytest
import torch
from torch.nn.functional import grid_sample

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import (
    Camera,
    check_rigid,
    intrinsics,
    look_at_origin,
    normalize_pixels,
    project,
    toed_in_rig,
    transform_points,
)

SIDE = 64
CENTER = (SIDE - 1) / 2


@pytest.fixture
def rig():
    return toed_in_rig(distance=1.0, half_angle=pi / 16, fov=pi / 3, side=SIDE)


def pixel_of(camera, point):
    pixels_N2, _ = camera.project(np.array([point], dtype=float))
    return pixels_N2[0]


def disparity(rig, point):
    return pixel_of(rig.left, point)[0] - pixel_of(rig.right, point)[0]


def test_the_papers_rig(rig):
    assert rig.baseline == pytest.approx(2 * sin(pi / 16))
    for camera, side in zip(rig.cameras, (-1, 1), strict=True):
        assert np.linalg.norm(camera.center) == pytest.approx(1)
        x, y, z = camera.center
        assert (np.sign(x), y) == (side, 0)
        assert degrees(atan2(x, z)) == pytest.approx(side * 11.25)


def test_optical_axes_meet_at_the_origin(rig):
    for camera in rig.cameras:
        pixels_N2, depth_N = camera.project(np.zeros((1, 3)))
        np.testing.assert_allclose(pixels_N2, [[CENTER, CENTER]])
        np.testing.assert_allclose(depth_N, [1.0])


def test_the_field_of_view_spans_the_image_from_edge_to_edge():
    """At 1 m, 60 degrees see 2 tan(30 degrees) metres, from pixel edge -0.5 to side - 0.5."""
    camera = Camera(intrinsics(radians(60), SIDE), look_at_origin(0.0, 1.0), SIDE, SIDE)
    top = pixel_of(camera, [0, np.tan(radians(30)), 0])
    right = pixel_of(camera, [np.tan(radians(30)), 0, 0])
    np.testing.assert_allclose(top, [CENTER, -0.5], atol=1e-9)
    np.testing.assert_allclose(right, [SIDE - 0.5, CENTER], atol=1e-9)


def test_the_bounding_sphere_of_a_unit_object_touches_the_image_borders(rig):
    """Its outline is seen at asin(0.5 / 1 m): 30 degrees, half the field of view."""
    for camera in rig.cameras:
        assert camera.clearance(np.zeros(3)) == pytest.approx(0.5)


def test_directions_in_the_image(rig):
    """Rig +X is to the right (u grows), rig +Y is up (v falls), rig +Z is nearer."""
    for camera in rig.cameras:
        right, up = pixel_of(camera, [0.1, 0, 0]), pixel_of(camera, [0, 0.1, 0])
        assert right[0] > CENTER
        assert right[1] == pytest.approx(CENTER)
        assert up[1] < CENTER
        assert up[0] == pytest.approx(CENTER)
        _, depth_N = camera.project(np.array([[0, 0, 0.1], [0, 0, 0], [0, 0, -0.1]]))
        assert (np.diff(depth_N) > 0).all()


def test_disparity_is_zero_at_the_fixation_point_positive_before_it_and_negative_behind(rig):
    """On the mid-line, z metres towards the cameras: 2 f sin(a) z / (1 - z cos(a))."""
    angle, focal = pi / 16, rig.left.K[0, 0]
    for z in (-0.5, -0.2, 0.0, 0.3, 0.5):
        expected = 2 * focal * sin(angle) * z / (1 - z * cos(angle))
        assert disparity(rig, [0, 0, z]) == pytest.approx(expected, abs=1e-9)
        assert np.sign(round(disparity(rig, [0, 0, z]), 9)) == np.sign(z)


def test_vertical_disparity_off_the_axes_only(rig):
    """A point at the right is nearer to the right camera, so it appears farther from the middle row there."""

    def vertical(point):
        return pixel_of(rig.left, point)[1] - pixel_of(rig.right, point)[1]

    for on_axis in ([0.3, 0, 0.1], [0, 0.3, 0.1], [0, -0.2, -0.3]):
        assert vertical(on_axis) == pytest.approx(0, abs=1e-9)
    assert vertical([0.3, 0.3, 0]) > 0.5
    assert vertical([-0.3, 0.3, 0]) < -0.5
    assert vertical([0.3, -0.3, 0]) < -0.5


def test_project_and_unproject_are_inverse(rig):
    rng = np.random.default_rng(0)
    points_N3 = rng.uniform(-0.5, 0.5, (200, 3))
    for camera in rig.cameras:
        pixels_N2, depth_N = camera.project(points_N3)
        np.testing.assert_allclose(camera.unproject(pixels_N2, depth_N), points_N3, atol=1e-12)
        again_N2, again_N = camera.project(camera.unproject(pixels_N2, 2 * depth_N))
        np.testing.assert_allclose(again_N2, pixels_N2, atol=1e-9)
        np.testing.assert_allclose(again_N, 2 * depth_N)


def test_depth_is_along_the_optical_axis_and_not_the_distance(rig):
    aside = rig.left.unproject(np.array([[0.0, 0.0]]), np.array([1.0]))
    assert rig.left.project(aside)[1][0] == pytest.approx(1)
    assert np.linalg.norm(aside[0] - rig.left.center) > 1.1


def test_torch_batches_agree_with_numpy(rig):
    points_BN3 = np.random.default_rng(1).uniform(-0.5, 0.5, (3, 7, 3))
    K_B33 = np.stack([camera.K for camera in (rig.left, rig.right, rig.left)])
    extrinsics_B44 = np.stack([camera.camera_from_rig for camera in (rig.left, rig.right, rig.left)])
    pixels_BN2, depth_BN = project(*map(torch.from_numpy, (points_BN3, K_B33, extrinsics_B44)))
    for b, camera in enumerate((rig.left, rig.right, rig.left)):
        expected_N2, expected_N = camera.project(points_BN3[b])
        np.testing.assert_allclose(pixels_BN2[b], expected_N2)
        np.testing.assert_allclose(depth_BN[b], expected_N)


def test_transform_points_takes_row_vectors():
    quarter_turn = np.array([[0.0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    np.testing.assert_allclose(transform_points(np.array([[1.0, 0, 0]]), quarter_turn), [[5, 7, 7]])


def ramp(height, width):
    """An image whose two channels hold u and v of each pixel, ``(1, 2, H, W)``."""
    v, u = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    return torch.stack([u, v]).double()[None]


def test_sampling_an_image_of_pixel_coordinates_returns_them():
    height, width = 48, 64
    rng = np.random.default_rng(2)
    pixels_N2 = torch.from_numpy(rng.uniform(0, 1, (500, 2)) * [width - 1, height - 1])
    sampled = grid_sample(
        ramp(height, width), normalize_pixels(pixels_N2, width, height)[None, None], align_corners=False
    )
    torch.testing.assert_close(sampled[0, :, 0].T, pixels_N2)


@pytest.mark.parametrize("stride", [2, 4, 16])
def test_the_same_coordinates_address_feature_maps_of_any_stride(stride):
    """A feature cell that is the mean of its block holds the block's mean coordinate: interpolation is exact."""
    side = 64
    features = torch.nn.functional.avg_pool2d(ramp(side, side), stride)
    border = (stride - 1) / 2  # from here on, between the centres of the outermost cells
    rng = np.random.default_rng(3)
    pixels_N2 = torch.from_numpy(rng.uniform(border, side - 1 - border, (500, 2)))
    sampled = grid_sample(features, normalize_pixels(pixels_N2, side, side)[None, None], align_corners=False)
    torch.testing.assert_close(sampled[0, :, 0].T, pixels_N2)


def test_image_corners_normalize_to_one():
    corners_N2 = torch.tensor([[-0.5, -0.5], [63.5, 47.5]])
    assert normalize_pixels(corners_N2, 64, 48).tolist() == [[-1, -1], [1, 1]]


def test_an_image_of_another_size_shows_the_same_from_edge_to_edge(rig):
    small = rig.right.resized(SIDE // 2, 3 * SIDE)
    assert (small.width, small.height) == (SIDE // 2, 3 * SIDE)
    for point in ([0.1, 0.2, -0.3], [-0.2, 0.05, 0.1]):
        expected = (pixel_of(rig.right, point) + 0.5) * [0.5, 3] - 0.5
        np.testing.assert_allclose(pixel_of(small, point), expected)


def test_clearance_is_the_distance_to_the_nearest_side_of_the_view():
    """A straight camera at (0, 0, 1) with 60 degrees: its sides are planes at 30 degrees to the axis."""
    camera = Camera(intrinsics(radians(60), SIDE), look_at_origin(0.0, 1.0), SIDE, SIDE)

    def expected(x, z):
        return (1 - z) * sin(radians(30)) - abs(x) * np.cos(radians(30))

    for x, z in ((0.0, 0.0), (0.1, 0.2), (-0.3, -0.4), (0.9, 0.0)):
        assert camera.clearance(np.array([x, 0, z])) == pytest.approx(expected(x, z))
        assert camera.clearance(np.array([0, x, z])) == pytest.approx(expected(x, z))
    on_the_edge = camera.unproject(np.array([[-0.5, 20.0]]), np.array([0.7]))[0]
    assert camera.clearance(on_the_edge) == pytest.approx(0, abs=1e-12)
    assert camera.clearance(np.array([0, 0, 2.0])) < 0  # behind the camera


def test_clearance_of_an_off_centre_wide_image():
    """The principal point at the left edge: the left side of the view is the plane of the axis."""
    K = np.array([[50.0, 0, -0.5], [0, 50, 23.5], [0, 0, 1]])
    camera = Camera(K, look_at_origin(0.0, 1.0), 64, 48)
    assert camera.clearance(np.array([0.05, 0, 0])) == pytest.approx(0.05)
    assert camera.clearance(np.array([-0.05, 0, 0])) == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("matrix", "complaint"),
    [
        (np.diag([1.0, 1, -1, 1]), "determinant"),
        (np.diag([2.0, 2, 2, 1]), "orthonormal"),
        (np.eye(3), r"4x4.*\(3, 3\)"),
        (np.full((4, 4), np.nan), "finite"),
        (np.zeros(4), "4x4"),
        (np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]), "last row"),
        (np.array([[1.0, 0.01, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "orthonormal"),
    ],
)
def test_what_is_no_rigid_transform_is_refused(matrix, complaint):
    with pytest.raises(UserError, match=f"camera_from_rig.*{complaint}"):
        check_rigid(matrix, "camera_from_rig")


def test_a_camera_refuses_bad_calibration():
    K = intrinsics(pi / 3, SIDE)
    with pytest.raises(UserError, match="camera_from_rig"):
        Camera(K, np.diag([1.0, 1, -1, 1]), SIDE, SIDE)
    for bad in (-K, np.full((3, 3), np.nan)):
        with pytest.raises(UserError, match="K: focal lengths"):
            Camera(bad, np.eye(4), SIDE, SIDE)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"distance": 0.0}, r"rig.distance.*0"),
        ({"distance": np.nan}, "rig.distance.*nan"),
        ({"half_angle": -0.1}, r"rig.half_angle.*-0.1"),
        ({"half_angle": pi}, r"rig.half_angle.*3.14"),
        ({"fov": pi}, "rig.fov"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(change, complaint):
    with pytest.raises(UserError, match=complaint):
        toed_in_rig(**({"distance": 1.0, "half_angle": 0.2, "fov": 1.0, "side": SIDE} | change))
