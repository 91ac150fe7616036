"""Mesh metrics on solids whose answers are known."""

import numpy as np
import pytest
import trimesh
from trimesh import Trimesh

from stereo_occ.metrics.mesh import compare_meshes
from stereo_occ.metrics.solid import mesh_iou
from stereo_occ.metrics.surface import (
    CUBE_DIAGONAL,
    Correspondence,
    chamfer_l1,
    correspond,
    f_score,
    normal_consistency,
    surface_points,
)
from stereo_occ.metrics.visibility import visible

CAMERAS = np.array([[-0.2, 0.0, 1.0], [0.2, 0.0, 1.0]])


def ball(radius):
    return trimesh.creation.icosphere(subdivisions=5, radius=radius)


def box(*extents, shift=(0, 0, 0)):
    mesh = trimesh.creation.box(extents=extents)
    mesh.apply_translation(shift)
    return mesh


def scores(predicted, true, count=20_000):
    return compare_meshes(predicted, true, CAMERAS, count, np.random.default_rng(0))


def test_a_mesh_against_itself():
    mesh = ball(0.4)
    result = scores(mesh, mesh)
    assert result.failure == ""
    assert result.values["mesh_iou"] == pytest.approx(1, abs=1e-9)
    assert result.values["chamfer_l1"] < 0.005  # two samples of one surface: half the spacing of the points
    assert result.values["chamfer_l1_x10"] == pytest.approx(10 * result.values["chamfer_l1"])
    assert result.values["normal_consistency"] == pytest.approx(1, abs=1e-3)
    assert result.values["f_score_2"] == pytest.approx(1, abs=1e-6)
    assert (result.values["recall_2_visible"], result.values["recall_2_occluded"]) == (1, 1)


def test_concentric_balls():
    """Every point is the difference of the radii away; the smaller ball is inside the larger one."""
    result = scores(ball(0.4), ball(0.25))
    assert result.values["chamfer_l1"] == pytest.approx(0.15, abs=1e-3)
    assert result.values["mesh_iou"] == pytest.approx((0.25 / 0.4) ** 3, abs=1e-3)
    assert result.values["normal_consistency"] == pytest.approx(1, abs=0.01)
    assert (result.values["f_score_1"], result.values["f_score_2"]) == (0, 0)
    near = scores(ball(0.4), ball(0.385))
    assert near.values["f_score_1"] == 0
    assert near.values["f_score_2"] == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("shift", [0.0, 0.1, 0.25, 0.5, 0.75])
def test_shifted_boxes(shift):
    overlap = max(0.0, 0.5 - shift) * 0.3 * 0.2
    union = 2 * 0.5 * 0.3 * 0.2 - overlap
    assert mesh_iou(box(0.5, 0.3, 0.2), box(0.5, 0.3, 0.2, shift=(shift, 0, 0))) == pytest.approx(
        overlap / union, abs=1e-9
    )


def test_iou_is_the_same_both_ways_and_of_bodies_apart():
    two = trimesh.util.concatenate([box(0.2, 0.2, 0.2), box(0.2, 0.2, 0.2, shift=(0.5, 0, 0))])
    assert mesh_iou(two, box(0.2, 0.2, 0.2)) == pytest.approx(0.5, abs=1e-9)
    assert mesh_iou(box(0.2, 0.2, 0.2), two) == pytest.approx(0.5, abs=1e-9)


def test_meshes_that_may_not_be_written_to_are_measured_too():
    cube = box(0.2, 0.2, 0.2)
    vertices, faces = np.array(cube.vertices), np.array(cube.faces)
    vertices.flags.writeable = faces.flags.writeable = False
    assert mesh_iou(Trimesh(vertices, faces, process=False), cube) == pytest.approx(1, abs=1e-9)


def test_normals_at_right_angles_and_turned_round():
    """Only the direction of a normal counts, not its sense; a plane against one at a right angle gives 0."""
    rng = np.random.default_rng(0)
    square = Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    turned = square.copy()
    turned.invert()
    upright = square.copy()
    upright.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    points = {
        name: surface_points(m, 2000, rng)
        for name, m in (("a", square), ("turned", turned), ("upright", upright))
    }
    for name, expected in (("turned", 1.0), ("upright", 0.0)):
        ways = correspond(points["a"], points[name]), correspond(points[name], points["a"])
        assert normal_consistency(*ways) == pytest.approx(expected, abs=1e-9)


def test_the_two_ways_weigh_alike():
    one = Correspondence(np.array([0.005, 0.5]), np.ones(2))
    other = Correspondence(np.full(8, 0.005), np.ones(8))
    assert chamfer_l1(one, other) == pytest.approx((0.2525 + 0.005) / 2)
    assert f_score(one, other, 0.01) == pytest.approx(2 * 0.5 * 1 / 1.5)
    assert f_score(one, other, 0.001) == 0


def test_an_empty_mesh_is_counted_with_the_worst_values():
    result = scores(Trimesh(), ball(0.3))
    assert result.failure == "empty mesh"
    assert result.values["chamfer_l1"] == CUBE_DIAGONAL == pytest.approx(np.sqrt(3))
    worst = dict.fromkeys(
        ("mesh_iou", "normal_consistency", "f_score_1", "f_score_2", "recall_2_visible", "recall_2_occluded"),
        0,
    )
    assert {name: result.values[name] for name in worst} == worst
    flat = Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False)
    assert scores(flat, ball(0.3)).failure == "empty mesh"


def test_an_open_mesh_has_no_volume_but_a_surface():
    opened = ball(0.3)
    opened.update_faces(np.arange(len(opened.faces)) > 0)
    result = scores(opened, ball(0.3))
    assert result.failure == "no solid"
    assert result.values["mesh_iou"] == 0
    assert result.values["f_score_2"] > 0.99


def test_points_are_uniform_by_area():
    """A box's large faces get as many more points as they are larger, in all their parts."""
    points = surface_points(box(1, 1, 0.1), 40_000, np.random.default_rng(1))
    top_N = points.normals_N3[:, 2] > 0.9
    assert top_N.mean() == pytest.approx(1 / 2.4, abs=0.001)
    assert points.points_N3[top_N, :2].mean(axis=0) == pytest.approx([0, 0], abs=0.01)
    assert (points.points_N3[top_N, 0] > 0.25).mean() == pytest.approx(0.25, abs=0.01)


def test_degenerate_faces_get_no_points():
    mesh = box(1, 1, 1)
    sliver = Trimesh(mesh.vertices, np.concatenate([mesh.faces, [[0, 0, 1]]]), process=False)
    assert np.isfinite(surface_points(sliver, 5000, np.random.default_rng(0)).normals_N3).all()


def test_cameras_see_the_front_and_not_what_is_behind():
    """Of a ball at distance 1 a camera sees the cap up to cos = radius / distance from its axis."""
    mesh = ball(0.3)
    points = surface_points(mesh, 20_000, np.random.default_rng(0))
    seen_N = visible(mesh, points.points_N3, np.array([[0, 0, 1.0]]))
    assert seen_N.mean() == pytest.approx((1 - 0.3) / 2, abs=0.01)
    assert points.points_N3[seen_N, 2].min() > 0.3 * 0.3 - 0.01
    both_N = visible(mesh, points.points_N3, np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    assert both_N.mean() == pytest.approx(0.7, abs=0.02)


def test_what_is_hidden_is_measured_apart():
    """Half a ball, the half towards the cameras, finds what is visible and little of the rest."""
    half = ball(0.3).difference(box(1, 1, 1, shift=(0, 0, -0.45)))
    result = scores(half, ball(0.3))
    assert result.values["recall_2_visible"] > 0.95
    assert result.values["recall_2_occluded"] < 0.3


def test_a_solid_that_overlaps_itself_is_no_more_than_its_like():
    two = trimesh.util.concatenate([box(0.2, 0.2, 0.2), box(0.2, 0.2, 0.2, shift=(0.1, 0, 0))])
    assert mesh_iou(two, two) <= 1
