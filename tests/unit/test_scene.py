"""Views drawn for the rigs that vary: what holds for each, and what the model is told."""

from math import pi

import numpy as np
import pytest
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.data.rigs import CalibrationErrorConfig, build_rig, perturbed
from stereo_occ.data.scene import draw_scene
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.shapes.procedural import procedural_shape

SIDE = 64


@pytest.fixture(scope="module")
def hull():
    return np.asarray(procedural_shape("mug", 0, 3).mesh.convex_hull.vertices)


def configs(*overrides):
    cfg = OmegaConf.to_object(compose_config("render", list(overrides)))
    return cfg.rig, cfg.placement


def scenes(hull, *overrides, count=40):
    rig, placement = configs(*overrides)
    return [
        draw_scene(rig, placement, SIDE, hull, np.random.default_rng([0, i]), np.random.default_rng([1, i]))
        for i in range(count)
    ]


EXACT = ["rig.errors.rotation_deg=0", "rig.errors.focal_percent=0", "rig.errors.principal_px=0"]


@pytest.mark.parametrize("rig", ["randomised", "rectified"])
@pytest.mark.parametrize("placement", ["paper", "free", "table"])
def test_the_object_is_in_the_cube_and_in_both_pictures(hull, rig, placement):
    for scene in scenes(hull, f"rig={rig}", f"placement={placement}"):
        points_N3 = scene.pose.to_rig(hull)
        assert np.abs(points_N3).max() <= 0.5
        for camera in scene.true_rig.cameras:
            pixels_N2, depth_N = camera.project(points_N3)
            assert (depth_N > 0.05).all()
            assert pixels_N2.min() > -0.5
            assert pixels_N2.max() < SIDE - 0.5


def test_paper_placement_puts_a_unit_object_at_the_centre_with_every_rig(hull):
    for rig in ("randomised", "rectified"):
        for scene in scenes(hull, f"rig={rig}", count=5):
            assert scene.pose.scale == pytest.approx(1)
            np.testing.assert_allclose(scene.pose.center_3, 0, atol=1e-9)


def test_units_lead_back_to_metres(hull):
    """Baselines and diagonals, in metres, lie in the ranges asked for."""
    for scene in scenes(hull, "rig=rectified", "placement=free"):
        assert 0.05 <= scene.rig.baseline * scene.unit <= 0.12
        assert 0.08 <= scene.pose.scale * scene.unit <= 0.3
        distance = np.linalg.norm(scene.true_rig.left.center - scene.pose.center_3) * scene.unit
        assert 0.4 <= distance <= 1.5


def test_the_cube_is_not_told_the_size(hull):
    """Diagonals in units of the cube scatter less than in metres, but are not constant."""
    scale_N = np.array([scene.pose.scale for scene in scenes(hull, "rig=rectified", "placement=free")])
    assert scale_N.min() >= 0.4
    assert scale_N.max() <= 1
    assert np.ptp(scale_N) > 0.1


@pytest.mark.parametrize("rig", ["randomised", "rectified"])
def test_told_and_true_cameras_differ_by_the_calibration_error_alone(hull, rig):
    exact = scenes(hull, f"rig={rig}", *EXACT, count=5)
    erring = scenes(hull, f"rig={rig}", "rig.errors.principal_px=3", *EXACT[:2], count=5)
    for first, second in zip(exact, erring, strict=True):
        for told, true in zip(first.rig.cameras, first.true_rig.cameras, strict=True):
            np.testing.assert_allclose(told.K, true.K)
            np.testing.assert_allclose(told.camera_from_rig, true.camera_from_rig, atol=1e-12)
        for told, true in zip(second.rig.cameras, second.true_rig.cameras, strict=True):
            np.testing.assert_allclose(told.K[[0, 1], [0, 1]], true.K[[0, 1], [0, 1]])
            assert np.abs(told.K[:2, 2] - true.K[:2, 2]).max() > 0.01


def test_calibration_errors_have_the_size_asked_for():
    rig = toed_in_rig(1.0, pi / 16, pi / 3, SIDE)
    rng = np.random.default_rng(0)
    angles, focals, principals = [], [], []
    for _ in range(400):
        other = perturbed(rig, CalibrationErrorConfig(0.5, 2.0, 1.5), rng)
        for a, b in zip(rig.cameras, other.cameras, strict=True):
            between = b.camera_from_rig[:3, :3] @ a.camera_from_rig[:3, :3].T
            angles.append(np.degrees(between[[2, 0, 1], [1, 2, 0]]))
            focals.append(100 * (b.K[0, 0] / a.K[0, 0] - 1))
            principals.append(b.K[:2, 2] - a.K[:2, 2])
            np.testing.assert_allclose(a.center, b.center, atol=1e-12)
    assert np.std(angles) == pytest.approx(0.5, rel=0.1)
    assert np.std(focals) == pytest.approx(2.0, rel=0.1)
    assert np.std(principals) == pytest.approx(1.5, rel=0.1)


def test_epipolar_lines_of_a_rectified_pair_are_rows(hull):
    for scene in scenes(hull, "rig=rectified", "placement=free", *EXACT, count=10):
        left_N2, right_N2 = (c.project(scene.pose.to_rig(hull))[0] for c in scene.rig.cameras)
        np.testing.assert_allclose(left_N2[:, 1], right_N2[:, 1], atol=1e-9)


def test_standing_objects_are_upright_and_seen_from_above(hull):
    for rig in ("paper", "randomised", "rectified"):
        for scene in scenes(hull, f"rig={rig}", "placement=table", "placement.standing.lying=0", count=10):
            np.testing.assert_allclose(scene.pose.rotation_33 @ [0, 1, 0], scene.up_3, atol=1e-9)
            assert scene.up_3[1] > 0.3
            assert scene.up_3[2] > 0


def test_lying_objects_lie(hull):
    for scene in scenes(hull, "placement=table", "placement.standing.lying=1", count=10):
        assert scene.pose.rotation_33 @ [0, 1, 0] @ scene.up_3 == pytest.approx(0, abs=1e-9)


def test_what_is_drawn_next_does_not_depend_on_the_rig(hull):
    following = set()
    for rig in ("paper", "randomised", "rectified"):
        rng = np.random.default_rng(3)
        draw_scene(*configs(f"rig={rig}"), SIDE, hull, rng, np.random.default_rng(4))
        following.add(rng.random())
    assert len(following) == 1


def test_an_error_in_the_calibration_changes_nothing_else(hull):
    exact, erring = (scenes(hull, "rig=randomised", *more, count=5) for more in (EXACT, []))
    for first, second in zip(exact, erring, strict=True):
        np.testing.assert_array_equal(first.pose.rig_from_object, second.pose.rig_from_object)
        np.testing.assert_array_equal(first.rig.left.camera_from_rig, second.rig.left.camera_from_rig)


@pytest.mark.parametrize("rig", ["paper", "randomised", "rectified"])
def test_the_middle_of_every_rig_sees_the_cubes_centre(rig):
    middle = build_rig(configs(f"rig={rig}")[0], SIDE)
    for camera in middle.cameras:
        ((u, v),), (depth,) = camera.project(np.zeros((1, 3)))
        assert depth > 0.5
        assert abs(u - 31.5) < 8
        assert v == pytest.approx(31.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (["rig=randomised", "rig.baseline=[0.5,0.2]"], r"rig\.baseline.*low <= high"),
        (["rig=randomised", "rig.vergence=[0,2]"], r"rig\.vergence"),
        (["rig=randomised", "rig.baseline=[3,3]"], r"rig\.baseline.*twice the distance"),
        (["rig=randomised", "rig.errors.focal_percent=-1"], r"rig\.errors\.focal_percent.*-1"),
        (["rig=randomised", "rig.fov_deg=[10,10]"], r"rig=randomised.*tries.*rig\.fov_deg"),
        (["rig=rectified", "rig.width=0"], r"rig\.width"),
        (["rig=rectified", "rig.diagonal=[0,1]"], r"rig\.diagonal"),
        (["rig=rectified", "rig.box_error=-0.1"], r"rig\.box_error"),
        (
            ["placement=table", "placement.standing.elevation_deg=[60,5]"],
            r"placement\.standing\.elevation_deg",
        ),
    ],
)
def test_wrong_values_are_refused_by_name(hull, change, message):
    with pytest.raises(UserError, match=message):
        scenes(hull, *change, count=1)


def test_a_pose_does_not_depend_on_the_resolution(hull):
    rig, placement = configs("rig=rectified", "placement=free")
    first, second = (
        draw_scene(rig, placement, side, hull, np.random.default_rng(0), np.random.default_rng(1))
        for side in (64, 128)
    )
    np.testing.assert_array_equal(first.pose.rig_from_object, second.pose.rig_from_object)
    assert second.unit == first.unit
