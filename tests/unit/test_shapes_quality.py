"""Figures of solids against closed formulas."""

import numpy as np
import pytest
import trimesh

from stereo_occ.shapes.distance import Surface, spread
from stereo_occ.shapes.quality import bodies_and_genus, cavity, deviation, wall_thickness


def shell(inner):
    inner = inner.copy()
    inner.invert()
    return trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), inner])


def open_box(wall):
    inside = trimesh.creation.box((1 - 2 * wall, 1 - 2 * wall, 2)).apply_translation([0, 0, 0.5 + wall])
    return trimesh.boolean.difference([trimesh.creation.box((1, 1, 1)), inside])


def test_genus_counts_handles():
    torus = trimesh.creation.torus(1, 0.2)
    pair = trimesh.util.concatenate([torus, torus.copy().apply_translation([5, 0, 0])])
    assert bodies_and_genus(torus) == {"bodies": 1, "genus": 1}
    assert bodies_and_genus(pair) == {"bodies": 2, "genus": 2}
    assert bodies_and_genus(trimesh.creation.box((1, 2, 3))) == {"bodies": 1, "genus": 0}


def test_wall_thickness_of_a_shell_and_of_a_ball():
    walls = wall_thickness(shell(trimesh.creation.box((0.9, 0.9, 0.9))))
    assert walls["wall_median"] == pytest.approx(0.05 / np.sqrt(3), rel=1e-3)
    assert walls["wall_p5"] == pytest.approx(0.05 / np.sqrt(3), rel=1e-3)
    ball = wall_thickness(trimesh.creation.icosphere(subdivisions=4))
    assert ball["wall_median"] == pytest.approx(2 / (2 * np.sqrt(3)), rel=0.01)


@pytest.mark.parametrize("turn", range(4))
def test_cavity_of_an_open_box_in_any_upright_position(turn):
    box = open_box(0.05)
    box.apply_transform(trimesh.transformations.rotation_matrix(turn * np.pi / 2, [1, 0, 0]))
    figures = cavity(box)
    assert figures["cavity"] == pytest.approx(0.9 * 0.9 * 0.95, rel=0.03)
    assert figures["void"] == 0


def test_what_holds_no_water_has_no_cavity():
    assert cavity(trimesh.creation.icosphere(subdivisions=3))["cavity"] < 0.01
    assert cavity(trimesh.creation.annulus(0.4, 0.5, 1.0))["cavity"] < 0.01


def test_a_void_is_empty_and_sealed():
    figures = cavity(shell(trimesh.creation.box((0.8, 0.8, 0.8))))
    assert figures["void"] == pytest.approx(0.8**3)
    assert figures["cavity"] == pytest.approx(0.8**3, rel=0.03)


def test_a_wall_thinner_than_a_cell_holds_water():
    assert cavity(open_box(0.002))["cavity"] > 0.93


def test_deviation_of_a_grown_ball_is_the_growth():
    ball = trimesh.creation.icosphere(subdivisions=4)
    figures = deviation(ball, ball.copy().apply_scale(1.05))
    for name in ("lost_mean", "lost_p95", "lost_p99"):
        assert figures[name] == pytest.approx(0.05 / ball.scale, rel=0.01)
    for name in ("gained_mean", "gained_p99"):
        assert figures[name] == pytest.approx(0.05 / ball.scale, rel=0.01)


def test_a_filled_cavity_is_a_loss_and_an_absorbed_end_is_none():
    hollow, full = shell(trimesh.creation.box((0.8, 0.8, 0.8))), trimesh.creation.box((1, 1, 1))
    assert deviation(hollow, full)["lost_p99"] == pytest.approx(0.1 / np.sqrt(3), rel=0.02)
    assert deviation(hollow, full)["gained_p99"] < 1e-9
    bars = [trimesh.creation.box((1, 0.2, 0.2)), trimesh.creation.box((0.2, 1, 0.2))]
    assert deviation(trimesh.util.concatenate(bars), trimesh.boolean.union(bars))["lost_p99"] < 1e-3


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1.0, 1e3])
def test_distances_are_right_in_any_unit(unit):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=unit)
    surface = Surface(ball, unit / 50)
    distance_N, _ = surface.distance(1.1 * ball.triangles_center, candidates=8)
    np.testing.assert_allclose(distance_N, 0.1 * np.linalg.norm(ball.triangles_center, axis=1), rtol=1e-3)
    assert surface.distance(ball.triangles_center)[0].max() < 1e-9 * unit


def test_spread_points_leave_no_gap_and_slender_triangles_cost_little():
    triangles = np.array(
        [[[0, 0, 0], [1, 0, 0], [0.2, 0.7, 0]], [[0, 0, 1], [1, 0, 1], [0.5, 1e-5, 1]]], float
    )
    points, face = spread(triangles, 0.05)
    assert np.bincount(face)[1] < 50
    rng = np.random.default_rng(0)
    weights = rng.dirichlet([1, 1, 1], 2000)
    for index in (0, 1):
        inside = weights @ triangles[index]
        gaps = np.linalg.norm(inside[:, None] - points[face == index], axis=2).min(axis=1)
        assert gaps.max() < 0.05
    on_plane = points[face == 0]
    assert (on_plane[:, 2] == 0).all()


def test_distance_to_a_box_is_exact():
    box = trimesh.creation.box((2, 2, 2))
    points = np.random.default_rng(0).uniform(-3, 3, (500, 3))
    outside = np.maximum(np.abs(points) - 1, 0)
    inside = np.minimum(np.abs(np.abs(points) - 1).min(axis=1), np.inf)
    expected = np.where((np.abs(points) < 1).all(axis=1), inside, np.linalg.norm(outside, axis=1))
    distance, _ = Surface(box, 0.05).distance(points, candidates=4)
    np.testing.assert_allclose(distance, expected, atol=2e-3)
    assert (distance > expected - 1e-9).all()
