from math import cos, pi, radians, sin

import numpy as np
import pytest
from scipy.stats import kstest

from stereo_occ.data.placement import draw_pose
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig

RIG = toed_in_rig(distance=1.0, half_angle=pi / 16, fov=pi / 3, side=64)
DRAWS = 3000


def free_poses(rig=RIG, diagonal=(0.4, 1.0)):
    rng = np.random.default_rng(0)
    return [draw_pose("free", diagonal, rig, rng) for _ in range(DRAWS)]


@pytest.fixture(scope="module")
def poses():
    return free_poses()


def sphere(count=200):
    """Directions spread evenly over the unit sphere (Fibonacci lattice), ``(count, 3)``."""
    z_N = 1 - (2 * np.arange(count) + 1) / count
    turn_N = np.arange(count) * pi * (3 - np.sqrt(5))
    ring_N = np.sqrt(1 - z_N**2)
    return np.stack([ring_N * np.cos(turn_N), ring_N * np.sin(turn_N), z_N], axis=1)


def test_the_paper_puts_unit_objects_at_the_fixation_point():
    rng = np.random.default_rng(0)
    drawn = [draw_pose("paper", (1.0, 1.0), RIG, rng) for _ in range(50)]
    assert all(pose.scale == 1 and (pose.center_3 == 0).all() for pose in drawn)
    assert len({pose.rotation_33.tobytes() for pose in drawn}) == 50


def test_free_diagonals_are_log_uniform(poses):
    fraction_N = np.log([pose.scale / 0.4 for pose in poses]) / np.log(1 / 0.4)
    assert kstest(fraction_N, "uniform").pvalue > 0.01


def test_free_rotations_are_uniform(poses):
    """Rejecting centres must not favour rotations."""
    cosine_N = np.array([(np.trace(pose.rotation_33) - 1) / 2 for pose in poses])
    angle_N = np.arccos(cosine_N.clip(-1, 1))
    assert kstest(angle_N, lambda theta: (theta - np.sin(theta)) / pi).pvalue > 0.01


def test_a_free_object_never_leaves_the_cube(poses):
    assert all((np.abs(pose.center_3) + pose.scale / 2 <= 0.5 + 1e-12).all() for pose in poses)


def test_a_free_object_is_whole_in_both_images(poses):
    """Every point of its bounding sphere projects between the outer edges of both images."""
    directions_N3 = sphere()
    for pose in poses[::3]:
        points_N3 = pose.center_3 + pose.scale / 2 * directions_N3
        for camera in RIG.cameras:
            pixels_N2, depth_N = camera.project(points_N3)
            assert (depth_N > 0).all()
            assert pixels_N2.min() >= -0.5
            assert pixels_N2.max() <= 63.5


def test_free_centres_use_the_room_there_is(poses):
    """Small objects reach far from the fixation point along every axis, large ones cannot."""
    small_N3 = np.array([pose.center_3 for pose in poses if pose.scale < 0.45])
    assert (small_N3.max(axis=0) > 0.15).all()
    assert (small_N3.min(axis=0) < -0.15).all()
    assert np.abs(small_N3.mean(axis=0))[:2].max() < 0.02  # the rig is symmetric about X = 0 and Y = 0
    large_N3 = np.array([pose.center_3 for pose in poses if pose.scale > 0.98])
    assert np.abs(large_N3).max() <= 0.01


@pytest.mark.parametrize("side", [64, 128, 224])
def test_a_unit_object_just_fits(side):
    """Only the fixation point itself keeps a unit diagonal inside the cube and the paper's views."""
    rig = toed_in_rig(distance=1.0, half_angle=radians(11.25), fov=radians(60), side=side)
    pose = draw_pose("free", (1.0, 1.0), rig, np.random.default_rng(0))
    np.testing.assert_allclose(pose.center_3, 0, atol=1e-12)


def test_a_rig_without_room_is_refused():
    narrow = toed_in_rig(distance=1.0, half_angle=pi / 16, fov=radians(20), side=64)
    assert 0.5 * cos(pi / 16) > sin(radians(10))  # the sphere is wider than the view
    with pytest.raises(UserError, match=r"placement=free.*diagonal 1\.00 m.*rig\.fov_deg"):
        draw_pose("free", (1.0, 1.0), narrow, np.random.default_rng(0))


def test_the_same_seed_gives_the_same_pose(poses):
    again = draw_pose("free", (0.4, 1.0), RIG, np.random.default_rng(0))
    np.testing.assert_array_equal(again.rig_from_object, poses[0].rig_from_object)
