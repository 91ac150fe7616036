"""From boxes in two images to the working cube and back to metres."""

from math import pi

import numpy as np
import pytest

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig, toed_in_rig, transform_points
from stereo_occ.geometry.crop import Box
from stereo_occ.geometry.cube import FILL, cube_at, ray, triangulate, working_cube
from stereo_occ.geometry.rotations import random_rotations

W, H, FOCAL, BASELINE = 960, 540, 700.0, 0.063
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def rectified(baseline=BASELINE, turn=None):
    """A parallel pair in the left camera's own frame (or that frame turned)."""
    K = np.array([[FOCAL, 0, (W - 1) / 2], [0, FOCAL, (H - 1) / 2], [0, 0, 1]])
    cameras = []
    for x in (0.0, baseline):
        pose = np.eye(4)
        pose[0, 3] = -x
        if turn is not None:
            rigid = np.eye(4)
            rigid[:3, :3] = turn
            pose = pose @ rigid
        cameras.append(Camera(K, pose, W, H))
    return StereoRig(*cameras)


def boxes_of(rig, points_N3):
    left, right = (Box.around(camera.project(points_N3)[0]) for camera in rig.cameras)
    return left, right


def block(center=(0.05, 0.03, 0.5), half=(0.04, 0.05, 0.04)):
    return np.asarray(center) + CORNERS * half


def test_triangulation_finds_the_point_that_is_seen():
    rng = np.random.default_rng(0)
    for turn in random_rotations(10, rng):
        rig = rectified(turn=turn)
        point_3 = turn.T @ rng.uniform([-0.3, -0.2, 0.4], [0.3, 0.2, 1.5])
        pixels = tuple(tuple(camera.project(point_3[None])[0][0]) for camera in rig.cameras)
        np.testing.assert_allclose(triangulate(rig, pixels), point_3, atol=1e-9)


def test_depth_is_focal_length_times_baseline_over_disparity():
    disparity = 84.0
    center_3 = triangulate(rectified(), ((500.0, 300.0), (500.0 - disparity, 300.0)))
    assert center_3[2] == pytest.approx(FOCAL * BASELINE / disparity)


def test_of_rays_that_pass_each_other_it_is_the_middle_of_their_nearest_points():
    """At half a metre on both optical axes' rows, one ray goes 10 pixels lower than the other."""
    row, disparity = (H - 1) / 2, FOCAL * BASELINE / 0.5
    u = (W - 1) / 2 + disparity / 2
    center_3 = triangulate(rectified(), ((u, row + 10), (u - disparity, row)))
    lines = [np.array([disparity / 2, 10, FOCAL]), np.array([-disparity / 2, 0, FOCAL])]
    starts = [np.zeros(3), np.array([BASELINE, 0, 0])]
    normal = np.cross(*lines)
    along = np.linalg.solve(np.stack([lines[0], -lines[1], normal], axis=1), starts[1] - starts[0])
    ends = [start + t * line for start, t, line in zip(starts, along[:2], lines, strict=True)]
    np.testing.assert_allclose(center_3, (ends[0] + ends[1]) / 2, atol=1e-12)
    assert abs(ends[0][1] - ends[1][1]) > 0.003


def test_other_cameras_of_the_same_images_are_cut_alike():
    rig, points_N3 = rectified(), block()
    cube = working_cube(rig, boxes_of(rig, points_N3), 64)
    other = rectified(BASELINE + 0.002)
    cut = cube.cut(other)
    inside_N3 = transform_points(points_N3, cube.cube_from_source)
    for whole, crop, camera in zip(other.cameras, cube.crops, cut.cameras, strict=True):
        expected_N2 = (whole.project(points_N3)[0] - [crop.left, crop.top]) * 64 / crop.extent - 0.5
        np.testing.assert_allclose(camera.project(inside_N3)[0], expected_N2, atol=1e-9)


def test_the_papers_rig_frame_is_the_cube_of_one_metre_about_its_fixation_point():
    rig = toed_in_rig(1.0, pi / 16, pi / 3, 64)
    whole = Box(-0.5, -0.5, 63.5, 63.5)
    cube = cube_at(rig, (whole, whole), 64, np.zeros(3), 1.0, margin=1.0)
    np.testing.assert_allclose(cube.cube_from_source, np.eye(4), atol=1e-12)
    for ours, paper in zip(cube.rig.cameras, rig.cameras, strict=True):
        np.testing.assert_allclose(ours.K, paper.K)
        np.testing.assert_allclose(ours.camera_from_rig, paper.camera_from_rig, atol=1e-12)


def test_crops_show_the_same_points_through_the_cubes_cameras():
    rig, points_N3 = rectified(), block()
    cube = working_cube(rig, boxes_of(rig, points_N3), 64)
    inside_N3 = transform_points(points_N3, cube.cube_from_source)
    for whole, crop, camera in zip(rig.cameras, cube.crops, cube.rig.cameras, strict=True):
        pixels_N2, depth_N = whole.project(points_N3)
        expected_N2 = (pixels_N2 - [crop.left, crop.top]) * 64 / crop.extent - 0.5
        found_N2, cube_depth_N = camera.project(inside_N3)
        np.testing.assert_allclose(found_N2, expected_N2, atol=1e-9)
        np.testing.assert_allclose(cube_depth_N * cube.unit, depth_N)
        assert found_N2.min() > -0.5
        assert found_N2.max() < 63.5


def test_metric_height_comes_back():
    rig, points_N3 = rectified(), block(half=(0.04, 0.06, 0.04))
    cube = working_cube(rig, boxes_of(rig, points_N3), 64)
    inside_N3 = transform_points(points_N3, cube.cube_from_source)
    sides_8 = np.linalg.norm(inside_N3[2] - inside_N3[0]) * cube.unit
    assert sides_8 == pytest.approx(0.12)


def test_the_cube_holds_the_object_and_is_not_much_larger():
    rng = np.random.default_rng(1)
    rig = rectified()
    directions_N3 = rng.standard_normal((500, 3))
    directions_N3 /= np.linalg.norm(directions_N3, axis=1, keepdims=True)
    for _ in range(50):
        half_3 = rng.uniform(0.05, 0.08, 3)
        points_N3 = rng.uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 1.4]) + half_3 * directions_N3
        cube = working_cube(rig, boxes_of(rig, points_N3), 64)
        assert np.abs(transform_points(points_N3, cube.cube_from_source)).max() < 0.5
        assert 0.4 < 2 * np.linalg.norm(half_3) / cube.unit < 1


def test_growing_the_whole_scene_changes_the_unit_alone():
    first = working_cube(rectified(), boxes_of(rectified(), block()), 64)
    rig = rectified(7 * BASELINE)
    grown = working_cube(rig, boxes_of(rig, 7 * block()), 64)
    assert grown.unit == pytest.approx(7 * first.unit)
    for a, b in zip(first.rig.cameras, grown.rig.cameras, strict=True):
        np.testing.assert_allclose(a.K, b.K)
        np.testing.assert_allclose(a.camera_from_rig, b.camera_from_rig, atol=1e-12)


def test_the_cube_does_not_depend_on_the_frame_of_the_cameras():
    turn = random_rotations(1, np.random.default_rng(2))[0]
    first = working_cube(rectified(), boxes_of(rectified(), block()), 64)
    rig = rectified(turn=turn)
    turned = working_cube(rig, boxes_of(rig, block() @ turn), 64)
    assert turned.unit == pytest.approx(first.unit)
    for a, b in zip(first.rig.cameras, turned.rig.cameras, strict=True):
        np.testing.assert_allclose(a.camera_from_rig, b.camera_from_rig, atol=1e-9)


def test_rows_of_a_rectified_pair_stay_rows_and_columns_lose_the_objects_disparity():
    rig, points_N3 = rectified(), block()
    left, right = working_cube(rig, boxes_of(rig, points_N3), 64).crops
    assert left.top == right.top
    assert left.extent == right.extent
    assert left.left - right.left == pytest.approx(FOCAL * BASELINE / 0.5, rel=0.1)


def test_axes_look_back_at_the_cameras_upright():
    rig, points_N3 = rectified(), block(center=(0.3, -0.1, 0.6))
    cube = working_cube(rig, boxes_of(rig, points_N3), 64)
    left_3, right_3 = (camera.center for camera in cube.rig.cameras)
    np.testing.assert_allclose((left_3 + right_3)[:2], 0, atol=1e-9)
    assert right_3[0] > left_3[0]
    assert left_3[1] == pytest.approx(0, abs=1e-9)
    assert ray(cube.rig.left, (31.5, 0.0))[1] > ray(cube.rig.left, (31.5, 63.0))[1]


def test_the_side_is_known_from_the_picture_alone():
    """A flat plate facing the cameras: its box is its true size at its distance."""
    rig = rectified()
    points_N3 = block(center=(0.0, 0.0, 0.8), half=(0.03, 0.04, 0.0))
    cube = working_cube(rig, boxes_of(rig, points_N3), 64)
    assert cube.unit == pytest.approx(FILL * 0.1, rel=0.01)


def test_the_side_of_something_off_the_axis_is_no_larger():
    """A ball of the same size at the same distance, in the middle of both images and near their corner."""
    rng = np.random.default_rng(3)
    ball_N3 = rng.standard_normal((2000, 3))
    ball_N3 *= 0.05 / np.linalg.norm(ball_N3, axis=1, keepdims=True)
    direction_3 = np.array([0.45, 0.25, 1.0])
    units = [
        working_cube(rectified(), boxes_of(rectified(), ball_N3 + center_3), 64).unit
        for center_3 in ([0.0, 0.0, 0.8], 0.8 * direction_3 / np.linalg.norm(direction_3))
    ]
    assert units[1] == pytest.approx(units[0], rel=0.06)
    assert units[0] == pytest.approx(FILL * 0.1 * np.sqrt(2), rel=0.01)


def test_swapped_images_are_refused():
    rig = rectified()
    left, right = boxes_of(rig, block())
    with pytest.raises(UserError, match=r"left and right not swapped"):
        working_cube(rig, (right, left), 64)
    swapped = StereoRig(rig.right, rig.left)
    with pytest.raises(UserError, match=r"swap them"):
        working_cube(swapped, (right, left), 64)


def test_a_mask_has_the_box_of_its_whole_pixels():
    mask = np.zeros((8, 10), bool)
    mask[2:5, 3:9] = True
    assert Box.of_mask(mask) == Box(2.5, 1.5, 8.5, 4.5)
    with pytest.raises(UserError, match="empty"):
        Box.of_mask(np.zeros((3, 3), bool))
