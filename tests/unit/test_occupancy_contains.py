"""Inside and outside against closed formulas, farther than 1e-4 of the diagonal from the surface."""

import numpy as np
import pytest
import trimesh

from stereo_occ.errors import UserError
from stereo_occ.occupancy.contains import contains


def convex_depth(mesh, points_N3):
    """Depth below the nearest face plane of a convex mesh: > 0 inside, exact for the faceted solid."""
    offsets_F = np.einsum("fi,fi->f", mesh.face_normals, mesh.triangles[:, 0])
    return (offsets_F - points_N3 @ mesh.face_normals.T).min(axis=1)


def hollow(outer, inner):
    """The outer solid with the inner one as a closed cavity."""
    inner = inner.copy()
    inner.invert()
    return trimesh.util.concatenate([outer, inner])


def near_and_far_points(mesh, count, seed):
    """Half uniform in the grown box, half within a few 1e-4 of the surface's vertices and faces."""
    rng = np.random.default_rng(seed)
    low, high = mesh.bounds
    margin = 0.05 * (high - low)
    uniform_N3 = rng.uniform(low - margin, high + margin, (count // 2, 3))
    surface_N3, _ = trimesh.sample.sample_surface(mesh, count // 2, seed=seed)
    return np.concatenate([uniform_N3, surface_N3 + 1e-3 * mesh.scale * rng.standard_normal((count // 2, 3))])


def check(mesh, depth, count=20_000):
    points_N3 = near_and_far_points(mesh, count, seed=3)
    depth_N = depth(points_N3)
    clear_N = np.abs(depth_N) > 1e-4 * mesh.scale
    assert 0.5 < clear_N.mean() < 1  # the exclusion zone is met, and is small
    wrong_N = contains(mesh, points_N3[clear_N]) != (depth_N[clear_N] > 0)
    assert wrong_N.sum() == 0


def test_convex_solids():
    for mesh in (
        trimesh.creation.icosphere(subdivisions=2),
        trimesh.creation.box((0.2, 1, 3)),
        trimesh.creation.cylinder(0.3, 1.0, sections=48),
    ):
        check(mesh, lambda points_N3, mesh=mesh: convex_depth(mesh, points_N3))


@pytest.mark.parametrize("scale", [1e-3, 1, 1e3])
def test_a_thin_shell_at_any_scale(scale):
    outer = trimesh.creation.icosphere(subdivisions=2, radius=scale)
    inner = trimesh.creation.icosphere(subdivisions=2, radius=0.99 * scale)
    check(
        hollow(outer, inner),
        lambda points_N3: np.minimum(convex_depth(outer, points_N3), -convex_depth(inner, points_N3)),
    )


def test_a_box_with_a_cavity():
    outer, inner = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.8, 0.9, 0.5))
    check(
        hollow(outer, inner),
        lambda points_N3: np.minimum(convex_depth(outer, points_N3), -convex_depth(inner, points_N3)),
    )


def test_a_torus():
    mesh = trimesh.creation.torus(1.0, 0.3, major_sections=256, minor_sections=256)

    def depth(points_N3):
        tube_N = np.hypot(np.hypot(points_N3[:, 0], points_N3[:, 1]) - 1.0, points_N3[:, 2])
        return 0.3 - tube_N

    points_N3 = near_and_far_points(mesh, 20_000, seed=4)
    depth_N = depth(points_N3)
    clear_N = np.abs(depth_N) > 2e-4 * mesh.scale  # chords of 256 sections sag by 0.75e-4 of the radius
    assert (contains(mesh, points_N3[clear_N]) == (depth_N[clear_N] > 0)).all()


def test_rays_through_vertices_and_edges():
    """From lattice points, rays of a simple direction would run exactly along edges and diagonals."""
    mesh = trimesh.creation.box((2, 2, 2)).subdivide().subdivide().subdivide()
    axis_A = np.linspace(-1.25, 1.25, 21)
    points_N3 = np.stack(np.meshgrid(axis_A, axis_A, axis_A), axis=-1).reshape(-1, 3)
    reach_N = np.abs(points_N3).max(axis=1)
    clear_N = np.abs(reach_N - 1) > 1e-3
    assert (contains(mesh, points_N3[clear_N]) == (reach_N[clear_N] < 1)).all()


def test_overlapping_parts_are_one_solid():
    left, right = (trimesh.creation.box((2, 1, 1)).apply_translation((x, 0, 0)) for x in (-0.5, 0.5))
    points_N3 = np.array([[0, 0, 0], [-1.2, 0.1, 0], [1.2, 0, 0.1], [0, 0.6, 0], [1.6, 0, 0]], float)
    np.testing.assert_array_equal(
        contains(trimesh.util.concatenate([left, right]), points_N3), [True, True, True, False, False]
    )


def test_no_points_and_only_far_points():
    mesh = trimesh.creation.box((1, 1, 1))
    assert contains(mesh, np.zeros((0, 3))).shape == (0,)
    assert not contains(mesh, np.full((5, 3), 7.0)).any()


def test_what_has_no_inside_is_refused():
    mesh = trimesh.creation.box((1, 1, 1))
    open_mesh = trimesh.Trimesh(mesh.vertices, mesh.faces[1:])
    inverted = mesh.copy()
    inverted.invert()
    with pytest.raises(UserError, match="watertight=False"):
        contains(open_mesh, np.zeros((1, 3)))
    with pytest.raises(UserError, match="volume=-1"):
        contains(inverted, np.zeros((1, 3)))
    with pytest.raises(UserError, match="got 1 that are not"):
        contains(mesh, np.array([[0, 0, 0], [np.nan, 0, 0]]))


def prism(radius, low, high, sections=24):
    """A convex prism around the z-axis."""
    mesh = trimesh.creation.cylinder(radius, high - low, sections=sections)
    return mesh.apply_translation([0, 0, (low + high) / 2])


def check_composed(mesh, convex, inside):
    """Labels where no convex part's surface is nearer than 1e-4; ``inside`` composes the parts' own labels."""
    points_N3 = near_and_far_points(mesh, 40_000, seed=5)
    depth_KN = np.stack([convex_depth(part, points_N3) for part in convex])
    clear_N = (np.abs(depth_KN) > 1e-4 * mesh.scale).all(axis=0)
    assert clear_N.mean() > 0.5
    wrong_N = contains(mesh, points_N3[clear_N]) != inside(*(depth_KN[:, clear_N] > 0))
    assert wrong_N.sum() == 0


def test_a_hollow_mug_with_a_handle():
    body, cavity = prism(0.4, 0, 1), prism(0.35, 0.05, 1.2)
    grip = trimesh.creation.box((0.5, 0.08, 0.6)).apply_translation([0.45, 0, 0.5])
    loop = trimesh.creation.box((0.4, 0.3, 0.5)).apply_translation([0.45, 0, 0.5])
    union, difference = trimesh.boolean.union, trimesh.boolean.difference
    mug = difference([union([body, difference([grip, loop])]), cavity])
    assert mug.euler_number == 0
    check_composed(mug, [body, cavity, grip, loop], lambda b, c, g, o: (b | (g & ~o)) & ~c)


def test_a_bowl():
    outer, inner = (trimesh.creation.icosphere(subdivisions=2, radius=radius) for radius in (1, 0.97))
    lid = trimesh.creation.box((3, 3, 2)).apply_translation([0, 0, 1.2])
    bowl = trimesh.boolean.difference([outer, inner, lid])
    check_composed(bowl, [outer, inner, lid], lambda o, i, above: o & ~i & ~above)


def test_a_bottle_with_an_inner_void():
    body, neck = prism(0.3, 0, 1), prism(0.1, 0.9, 1.4)
    void, channel = prism(0.28, 0.02, 0.98), prism(0.08, 0.9, 1.35)
    union = trimesh.boolean.union
    bottle = trimesh.boolean.difference([union([body, neck]), union([void, channel])])
    assert bottle.body_count == 2
    check_composed(bottle, [body, neck, void, channel], lambda b, n, v, c: (b | n) & ~v & ~c)


def test_nested_shells():
    balls = [trimesh.creation.icosphere(subdivisions=2, radius=radius) for radius in (1, 0.95, 0.5, 0.48)]
    shells = trimesh.util.concatenate([hollow(*balls[:2]), hollow(*balls[2:])])
    check_composed(shells, balls, lambda a, b, c, d: (a & ~b) | (c & ~d))


def test_an_overlap_of_two_parts_wound_alike_is_solid_from_every_side():
    cross = trimesh.util.concatenate([prism(0.2, -1, 1), trimesh.creation.box((2, 0.2, 0.2))])
    parts = cross.split()
    check_composed(cross, list(parts), lambda a, b: a | b)


def test_far_from_the_origin():
    mesh = hollow(trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.98, 0.98, 0.98)))
    points_N3 = near_and_far_points(mesh, 10_000, seed=6)
    moved = mesh.copy().apply_translation([3000, -2000, 1000])
    reach_N = np.abs(points_N3).max(axis=1)
    clear_N = (np.abs(reach_N - 0.5) > 1e-4) & (np.abs(reach_N - 0.49) > 1e-4)
    inside_N = contains(moved, points_N3[clear_N] + [3000, -2000, 1000])
    np.testing.assert_array_equal(inside_N, ((reach_N < 0.5) & (reach_N > 0.49))[clear_N])
