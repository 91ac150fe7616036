"""Curves and solids against analytic lengths, radii and volumes."""

import numpy as np
import pytest

from stereo_occ.shapes import curves, solids, warps


def test_bezier_of_a_straight_control_polygon_is_the_straight_line():
    points = curves.bezier([[0, 0], [1, 2], [2, 4], [3, 6]], count=7)
    np.testing.assert_allclose(points[:, 1], 2 * points[:, 0], atol=1e-12)
    np.testing.assert_allclose(points[[0, -1]], [[0, 0], [3, 6]], atol=1e-12)


def test_monotone_profile_never_overshoots_its_knots():
    radii = curves.monotone([0, 0.2, 0.8, 1], [1.0, 0.5, 0.5, 2.0], count=200)[:, 0]
    assert radii.min() == pytest.approx(0.5)
    assert radii.max() == pytest.approx(2.0)
    assert np.all(np.diff(radii[radii.argmin() :]) >= -1e-12)


def test_resampled_points_are_equally_spaced():
    steps = np.linalg.norm(
        np.diff(curves.resampled(np.array([[0.0, 0], [0.1, 0], [2, 0], [2, 1]]), 31), axis=0), axis=1
    )
    np.testing.assert_allclose(steps[[0, 5, -1]], 0.1, rtol=1e-6)


def test_smallest_bend_of_a_circle_is_its_radius():
    angle = np.linspace(0, 5, 100)
    circle = 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert curves.smallest_bend(circle) == pytest.approx(0.3, rel=1e-6)


def test_fillets_stay_between_their_corners_and_keep_the_ends():
    corners = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    points = curves.filleted(corners, 10.0)
    np.testing.assert_array_equal(points[[0, -1]], corners[[0, -1]])
    assert points[:, 0].max() == pytest.approx(1.0, abs=0.1)
    assert np.linalg.norm(points - [1, 0], axis=1).min() > 0.1
    assert points.min() >= 0
    assert points.max() <= 1


def test_lathe_of_a_cone_and_of_a_ring_have_the_volumes_of_their_polygons():
    segments = 40
    disc = segments / 2 * np.sin(2 * np.pi / segments)
    cone = solids.lathe(solids.section_of(np.array([[0.8, 0.0], [0.0, 1.5]])), segments, tolerance=0)
    assert cone.volume() == pytest.approx(disc * 0.8**2 * 1.5 / 3, rel=1e-6)
    ring = solids.lathe(solids.rectangle((0.5, 0.7), (1.0, 1.2)), segments, tolerance=0)
    assert ring.volume() == pytest.approx(disc * (0.7**2 - 0.5**2) * 0.2, rel=1e-6)
    assert ring.genus() == 1


def test_rounding_takes_the_corners_off_and_fills_the_nooks():
    square = solids.section_of(np.array([[0.5, 0.0], [0.5, 1.0]]))
    corner = (4 - np.pi) * 0.1**2
    assert solids.rounded(square, outward=0.1).area() == pytest.approx(1 - corner, rel=1e-3)
    step = square + solids.section_of(np.array([[1.0, 0.0], [1.0, 0.3]]))
    filled = solids.rounded(step, inward=0.1).area() - step.area()
    assert filled == pytest.approx(2 * corner / 4, rel=0.05)


def test_sweep_along_a_straight_line_is_a_cylinder_with_outward_faces():
    path = np.stack([np.full(5, 0.3), np.linspace(0, 2, 5)], axis=1)
    tube = solids.sweep(path, np.tile([[0.1, 0.2]], (5, 1)), sides=30)
    assert tube.volume() == pytest.approx(2 * 0.1 * 0.2 * 15 * np.sin(2 * np.pi / 30), rel=1e-6)
    np.testing.assert_allclose(tube.bounding_box(), [0.2, -0.2, 0, 0.4, 0.2, 2], atol=2e-3)


def test_superelliptic_section_keeps_the_width_and_scales_the_depth():
    can = solids.lathe(solids.section_of(np.array([[0.5, 0.0], [0.5, 1.0]])), 400)
    ellipse = warps.with_section(can, exponent=2.0, aspect=0.6)
    assert ellipse.volume() == pytest.approx(np.pi * 0.5 * 0.3, rel=1e-3)
    boxy = warps.with_section(can, exponent=80.0, aspect=0.6)
    assert boxy.volume() == pytest.approx(1.0 * 0.6, rel=0.02)
    np.testing.assert_allclose(boxy.bounding_box(), [-0.5, -0.3, 0, 0.5, 0.3, 1], atol=1e-3)


def test_section_weight_zero_leaves_the_solid_round():
    can = solids.lathe(solids.section_of(np.array([[0.5, 0.0], [0.5, 1.0]])), 40)
    same = warps.with_section(can, 6.0, 0.5, weight=np.zeros_like)
    assert same.volume() == pytest.approx(can.volume(), rel=1e-12)


def test_mesh_has_y_up_and_keeps_x_and_the_volume():
    can = solids.lathe(solids.section_of(np.array([[0.5, 1.0], [0.5, 4.0]])), 40).translate((7, 0, 0))
    mesh = solids.trimesh_of(can)
    np.testing.assert_allclose(mesh.bounds, [[6.5, 1, -0.5], [7.5, 4, 0.5]], atol=1e-12)
    assert mesh.volume == pytest.approx(can.volume(), rel=1e-6)


def test_slab_is_the_bounding_box_between_two_heights():
    can = solids.lathe(solids.section_of(np.array([[0.5, 0.0], [0.5, 1.0]])), 40)
    np.testing.assert_allclose(solids.slab(can, -3, 0.25).bounding_box(), [-0.5, -0.5, 0, 0.5, 0.5, 0.25])


def test_leaning_shears_only_what_is_above_and_keeps_the_volume():
    can = solids.lathe(solids.section_of(np.array([[0.5, 0.0], [0.5, 1.0]])), 40).refine(8)
    bent = warps.leaning(can, start=0.4, slope=0.5)
    assert bent.volume() == pytest.approx(can.volume(), rel=1e-6)
    np.testing.assert_allclose(bent.trim_by_plane((0, 0, -1), -0.4).bounding_box()[3], 0.5, atol=1e-3)
    np.testing.assert_allclose(bent.bounding_box()[3], 0.5 + 0.5 * 0.6 / 2, atol=1e-3)


def test_scallops_wave_the_rim_and_not_the_base_and_peaks_lift_the_corners():
    can = solids.lathe(solids.section_of(np.array([[0.5, 0.0], [0.5, 1.0]])), 80)
    x, y, z = warps.scalloped(can, lobes=5, depth=0.1).to_mesh64().vert_properties[:, :3].T
    radius = np.hypot(x, y)
    rim = radius[(z > 0.99) & (radius > 0.1)]
    np.testing.assert_allclose([rim.min(), rim.max()], [0.45, 0.55], rtol=5e-3)
    np.testing.assert_allclose(radius[(z < 0.01) & (radius > 0.1)], 0.5, rtol=2e-3)
    assert warps.peaked(can, rise=0.2).bounding_box()[5] == pytest.approx(1.2, rel=1e-3)
