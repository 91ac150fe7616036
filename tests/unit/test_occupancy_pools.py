import numpy as np
import pytest
import trimesh

from stereo_occ.errors import UserError
from stereo_occ.occupancy.contains import contains
from stereo_occ.occupancy.pools import box_pool, surface_pool
from stereo_occ.shapes.shape import PARTS, Shape

EXTENT = np.array([0.6, 0.48, 0.64])  # diagonal 1


def box_shape(parts=None):
    return Shape("mug", "box", trimesh.creation.box(EXTENT), parts or {})


def slab(low_x, high_x):
    """Everything with low_x < x < high_x, and more."""
    return trimesh.creation.box((high_x - low_x, 2, 2)).apply_translation(((low_x + high_x) / 2, 0, 0))


def test_box_pool_fills_the_box_uniformly():
    pool = box_pool(box_shape(), 20_000, np.random.default_rng(0))
    assert pool.occupied_N.all()
    assert pool.points_N3.dtype == np.float32
    counts, _ = np.histogramdd(pool.points_N3, bins=4, range=[(-e / 2, e / 2) for e in EXTENT])
    expected = 20_000 / 64
    chi2 = ((counts - expected) ** 2 / expected).sum()
    assert chi2 < 63 + 4 * np.sqrt(2 * 63)
    assert counts.sum() == 20_000


def test_occupied_fraction_is_the_volume_fraction():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    shape = Shape("bowl", "ball", mesh).normalized()
    pool = box_pool(shape, 40_000, np.random.default_rng(1))
    fraction = shape.mesh.volume / shape.mesh.bounding_box.volume
    assert abs(pool.occupied_N.mean() - fraction) < 4 * np.sqrt(fraction * (1 - fraction) / 40_000)


def test_labels_are_those_of_the_stored_points():
    shape = Shape("bowl", "ball", trimesh.creation.icosphere(subdivisions=2)).normalized()
    for pool in (
        box_pool(shape, 5_000, np.random.default_rng(2)),
        surface_pool(shape, 5_000, np.random.default_rng(2)),
    ):
        restored_N3 = (pool.low_3 + (pool.grid_N3 + 0.5) / 65536 * pool.extent_3).astype(np.float32)
        np.testing.assert_array_equal(pool.points_N3, restored_N3)
        np.testing.assert_array_equal(pool.occupied_N, contains(shape.mesh, restored_N3))


def test_surface_pool_distances_follow_the_sigmas():
    """Above a large flat face the height is N(0, sigma), with each sigma on every second point."""
    pool = surface_pool(box_shape(), 40_000, np.random.default_rng(3), sigmas=(0.005, 0.02))
    points_N3 = pool.points_N3.astype(float)
    # Seen from above the middle of the top face, other faces are farther than 4 sigma.
    above_N = (np.abs(points_N3[:, :2]) < EXTENT[:2] / 2 - 0.1).all(axis=1) & (points_N3[:, 2] > 0.1)
    height_N = points_N3[:, 2] - EXTENT[2] / 2
    for phase, sigma in enumerate((0.005, 0.02)):
        sample = height_N[phase::2][above_N[phase::2]]
        assert len(sample) > 500
        assert sample.std() == pytest.approx(sigma, rel=0.1)
        assert abs(sample.mean()) < 4 * sigma / np.sqrt(len(sample))
    assert pool.occupied_N[above_N].mean() == pytest.approx(0.5, abs=0.05)


def test_surface_pool_stays_in_the_grown_box():
    pool = surface_pool(box_shape(), 20_000, np.random.default_rng(4), sigmas=(0.03,))
    excess_N = (np.abs(pool.points_N3) - EXTENT / 2).max(axis=1)
    assert 0.05 < excess_N.max() <= 0.09 + 1e-6


def test_same_seed_same_pool():
    one, two, other = (surface_pool(box_shape(), 100, np.random.default_rng(seed)) for seed in (7, 7, 8))
    np.testing.assert_array_equal(one.grid_N3, two.grid_N3)
    assert (one.grid_N3 != other.grid_N3).any()


def test_part_codes_and_their_priority():
    """Slabs along x; the handle overlaps the floor and wins, whatever the order they are given in."""
    parts = {"floor": slab(-0.4, -0.1), "handle": slab(-0.2, 0.1), "neck": slab(0.0, 0.2)}
    for given in (parts, dict(reversed(parts.items()))):
        pool = box_pool(box_shape(given), 2_000, np.random.default_rng(5))
        x_N = pool.points_N3[:, 0]
        expected = np.select(
            [x_N < -0.2, x_N < 0.1, x_N < 0.2],
            [PARTS.index(p) for p in ("floor", "handle", "neck")],
            PARTS.index("wall"),
        )
        np.testing.assert_array_equal(pool.part_N, expected)
        assert pool.part_N.dtype == np.uint8


def test_outside_points_have_no_part():
    shape = Shape(
        "mug", "ball", trimesh.creation.icosphere(subdivisions=2), {"handle": slab(0, 2)}
    ).normalized()
    pool = box_pool(shape, 2_000, np.random.default_rng(6))
    np.testing.assert_array_equal(pool.part_N == 0, ~pool.occupied_N)
    right_N = pool.points_N3[:, 0] > 0
    assert (pool.part_N[pool.occupied_N & right_N] == PARTS.index("handle")).all()
    assert (pool.part_N[pool.occupied_N & ~right_N] == PARTS.index("wall")).all()


def test_mistakes():
    with pytest.raises(UserError, match=r"lid"):
        box_pool(box_shape({"lid": slab(0, 1)}), 10, np.random.default_rng(0))
    with pytest.raises(UserError, match=r"sigmas.*-0.1"):
        surface_pool(box_shape(), 10, np.random.default_rng(0), sigmas=(0.1, -0.1))
