import numpy as np
import pytest
from skimage.measure import marching_cubes

from stereo_occ.errors import UserError
from stereo_occ.meshing import sample_field

LOW, HIGH = -0.5 * np.ones(3), 0.5 * np.ones(3)


def extract_mesh(*arguments, steps=0, **settings):
    return sample_field(*arguments, **settings).surface(steps)


def ball(radius, center=(0.0, 0, 0)):
    return lambda points_N3: 50 * (radius - np.linalg.norm(points_N3 - np.array(center), axis=1))


def torus(points_N3, major=0.3, minor=0.1):
    return minor - np.hypot(np.hypot(points_N3[:, 0], points_N3[:, 1]) - major, points_N3[:, 2])


def mug(points_N3):
    """An open cup with 12 mm walls and a handle 16 mm thick: thinner than the coarsest cells."""
    x_N, y_N, z_N = points_N3.T
    radius_N = np.hypot(x_N, z_N)
    outer_N = np.minimum(0.22 - radius_N, 0.3 - np.abs(y_N))
    inner_N = np.minimum(0.208 - radius_N, y_N + 0.288)
    handle_N = 0.008 - np.hypot(np.hypot(x_N - 0.22, y_N) - 0.15, z_N)
    handle_N = np.minimum(handle_N, radius_N - 0.215)
    return 50 * np.maximum(np.minimum(outer_N, -inner_N), handle_N)


def dense(occupancy, resolution, level=0.0):
    """Marching cubes on every sample of the grid, for objects that do not touch its border."""
    axis_A = np.linspace(-0.5, 0.5, resolution + 1)
    points_N3 = np.stack(np.meshgrid(axis_A, axis_A, axis_A, indexing="ij"), axis=-1).reshape(-1, 3)
    values = occupancy(points_N3.astype(np.float32)).reshape((resolution + 1,) * 3)
    vertices_V3, faces_F3, _, _ = marching_cubes(values, level, gradient_direction="ascent")
    return vertices_V3 / resolution - 0.5, faces_F3


def recorded(occupancy, sizes):
    """The same function, which notes how many points it is asked each time."""
    return lambda points_N3: sizes.append(len(points_N3)) or occupancy(points_N3)


@pytest.mark.parametrize("occupancy", [ball(0.31), torus, mug])
@pytest.mark.parametrize("resolution", [64, 96])
def test_equal_to_the_full_grid_at_a_fraction_of_its_cost(occupancy, resolution):
    sizes = []
    mesh = extract_mesh(recorded(occupancy, sizes), LOW, HIGH, resolution)
    vertices_V3, faces_F3 = dense(occupancy, resolution)
    np.testing.assert_allclose(mesh.vertices, vertices_V3, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, faces_F3)
    assert sum(sizes) < 0.3 * (resolution + 1) ** 3
    assert mesh.is_volume


def test_no_point_is_asked_twice():
    asked = []
    extract_mesh(lambda points_N3: asked.append(points_N3) or torus(points_N3), LOW, HIGH, 128)
    points_N3 = np.concatenate(asked)
    assert len(np.unique(points_N3, axis=0)) == len(points_N3)


def test_volume_place_and_outward_faces_of_a_ball():
    center = np.array([0.1, -0.05, 0.02])
    mesh = extract_mesh(ball(0.3, center), LOW, HIGH, 64)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.3**3, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - center, axis=1), 0.3, atol=3e-4)
    outward_F = np.einsum("fi,fi->f", mesh.face_normals, mesh.triangles_center - center)
    assert (outward_F > 0).all()


def test_the_box_may_be_anywhere_and_oblong():
    center, low, high = np.array([5.0, 0, -3]), np.array([4.0, -1, -6]), np.array([6.0, 2, -1])
    mesh = extract_mesh(ball(0.7, center), low, high, 64)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - center, axis=1), 0.7, atol=2e-3)


def test_the_level_moves_the_surface():
    mesh = extract_mesh(ball(0.3), LOW, HIGH, 64, level=2.5)  # 50 (0.3 - r) = 2.5
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.25, atol=3e-4)


def test_closed_where_the_object_leaves_the_box():
    mesh = extract_mesh(ball(0.4, (0.5, 0.5, 0.5)), LOW, HIGH, 64)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.4**3 / 8, rel=5e-3)
    assert mesh.bounds[1] == pytest.approx(0.5, abs=1e-5)


def test_a_full_box():
    mesh = extract_mesh(lambda points_N3: np.full(len(points_N3), np.inf), LOW, HIGH, 16)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("value", [-1.0, 0.0, -np.inf, np.nan])
def test_nothing_inside_gives_an_empty_mesh(value):
    mesh = extract_mesh(lambda points_N3: np.full(len(points_N3), value), LOW, HIGH, 32)
    assert len(mesh.vertices) == len(mesh.faces) == 0


def test_nan_and_infinite_logits_leave_the_mesh_finite():
    def occupancy(points_N3):
        logits_N = np.where(np.linalg.norm(points_N3, axis=1) < 0.3, np.inf, -np.inf)
        return np.where(points_N3[:, 0] > 0, logits_N, np.nan)

    mesh = extract_mesh(occupancy, LOW, HIGH, 32)
    assert np.isfinite(mesh.vertices).all()
    assert mesh.volume == pytest.approx(2 / 3 * np.pi * 0.3**3, rel=0.1)


def test_any_logits_give_a_closed_mesh():
    """Sums of waves: every ambiguous case of marching cubes, and surfaces that run out of the box."""
    rng = np.random.default_rng(0)
    for _ in range(3):
        waves, phases = rng.normal(scale=30, size=(3, 30)), rng.uniform(0, 6, 30)
        mesh = extract_mesh(lambda p, w=waves, f=phases: np.sin(p @ w + f).sum(axis=1), LOW, HIGH, 32)
        assert mesh.is_volume


def test_batches_bound_the_points_asked_at_once():
    sizes = []
    small = extract_mesh(recorded(torus, sizes), LOW, HIGH, 64, batch=1000)
    assert max(sizes) == 1000
    np.testing.assert_array_equal(small.vertices, extract_mesh(torus, LOW, HIGH, 64).vertices)


def squashed(points_N3):
    """A torus whose logits are far from linear about its surface."""
    inside_N = torus(points_N3)
    return np.where(inside_N > 0, 3.0, 0.3) * np.sign(inside_N) * np.log1p(200 * np.abs(inside_N))


def test_steps_find_the_surface_where_logits_are_not_linear():
    errors, volumes = [], []
    for steps in (0, 1, 2, 5):
        mesh = extract_mesh(squashed, LOW, HIGH, 32, steps=steps)
        errors.append(np.abs(torus(mesh.vertices)).max())
        volumes.append(mesh.volume)
        assert mesh.is_volume
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert errors[3] < 0.2 * errors[0]
    assert volumes[3] == pytest.approx(2 * np.pi**2 * 0.3 * 0.1**2, rel=0.01)


def test_steps_keep_faces_vertices_on_their_edges_and_the_closing_layer():
    ends = extract_mesh(ball(0.4, (0.5, 0.5, 0.5)), LOW, HIGH, 32)
    found = extract_mesh(ball(0.4, (0.5, 0.5, 0.5)), LOW, HIGH, 32, steps=3)
    np.testing.assert_array_equal(found.faces, ends.faces)
    assert np.abs(found.vertices - ends.vertices).max() < 1 / 32
    assert found.bounds[1] == pytest.approx(0.5, abs=1e-5)


def test_steps_of_a_full_box_change_nothing():
    full = extract_mesh(lambda points_N3: np.ones(len(points_N3)), LOW, HIGH, 16, steps=2)
    assert full.volume == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"resolution": 0}, "at least 1, got 0"),
        ({"batch": 0}, "at least 1, got 64 and 0"),
        ({"high": LOW}, "low must be below high"),
    ],
)
def test_mistakes(change, complaint):
    with pytest.raises(UserError, match=complaint):
        extract_mesh(torus, **{"low": LOW, "high": HIGH, "resolution": 64, "batch": 10} | change)
