import numpy as np
import pytest
import torch
import trimesh
from samples import iou

from stereo_occ.errors import UserError
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.occupancy.contains import contains
from stereo_occ.occupancy.pools import box_pool, surface_pool
from stereo_occ.occupancy.queries import cube_queries, outside_queries, pool_queries
from stereo_occ.shapes.shape import Shape


def mug_like():
    """A solid cylinder with a block on one side: no symmetry that a random rotation could hide behind."""
    body = trimesh.creation.cylinder(0.25, 0.8, sections=40)
    block = trimesh.creation.box((0.6, 0.1, 0.3)).apply_translation((0.35, 0, 0.2))
    return Shape("mug", "m", trimesh.util.concatenate([body, block])).normalized()


SHAPE = mug_like()
POOL = box_pool(SHAPE, 30_000, np.random.default_rng(0))


def poses():
    rng = np.random.default_rng(1)
    paper = [Pose(rotation, 1.0, np.zeros(3)) for rotation in random_rotations(4, rng)]
    free = [Pose(rotation, 0.6, rng.uniform(-0.2, 0.2, 3)) for rotation in random_rotations(4, rng)]
    return paper + free


def box_of(pose, points_N3):
    object_N3 = pose.to_object(points_N3)
    return ((object_N3 > POOL.low_3) & (object_N3 < POOL.low_3 + POOL.extent_3)).all(axis=1)


@pytest.mark.parametrize("pose", poses())
def test_truth_as_prediction_has_iou_1_under_any_pose(pose):
    posed = SHAPE.mesh.copy().apply_transform(pose.rig_from_object)
    rng = np.random.default_rng(2)
    for queries in (pool_queries(POOL, pose, 3000, rng), cube_queries(POOL, pose, 20_000, rng)):
        predicted_N = contains(posed, queries.points_N3)
        score = iou(torch.tensor(predicted_N)[None], torch.tensor(queries.occupied_N)[None])
        assert queries.occupied_N.sum() > 100
        assert float(score) > 0.999  # a point within float32 of the surface may flip


def test_points_left_in_the_object_frame_score_far_less():
    rng = np.random.default_rng(3)
    for pose in poses():
        posed = SHAPE.mesh.copy().apply_transform(pose.rig_from_object)
        queries = pool_queries(POOL, pose, 3000, rng)
        predicted_N = contains(posed, pose.to_object(queries.points_N3))
        assert float(iou(torch.tensor(predicted_N)[None], torch.tensor(queries.occupied_N)[None])) < 0.8


@pytest.mark.parametrize("pose", poses())
def test_cube_queries_occupied_fraction_is_the_posed_volume(pose):
    count = 40_000
    queries = cube_queries(POOL, pose, count, np.random.default_rng(4))
    union = trimesh.boolean.union(SHAPE.mesh.split(), engine="manifold")
    volume = union.volume * pose.scale**3  # the cube's volume is 1
    assert abs(queries.occupied_N.mean() - volume) < 4.5 * np.sqrt(volume / count * 2)


@pytest.mark.parametrize("pose", poses()[::3])
def test_cube_queries_are_uniform_across_the_edge_of_the_box(pose):
    """The replaced points must be neither denser nor sparser than the others."""
    count = 40_000
    points_N3 = cube_queries(POOL, pose, count, np.random.default_rng(5)).points_N3
    cells, _ = np.histogramdd(points_N3, bins=8, range=[(-0.5, 0.5)] * 3)
    expected = count / 8**3
    assert cells.sum() == count
    assert ((cells - expected) ** 2 / expected).sum() < 511 + 4.5 * np.sqrt(2 * 511)
    volume = POOL.extent_3.prod() * pose.scale**3
    assert abs(box_of(pose, points_N3).mean() - volume) < 4.5 * np.sqrt(volume * (1 - volume) / count)
    inner, _ = np.histogramdd(
        pose.to_object(points_N3),
        bins=4,
        range=list(zip(POOL.low_3, POOL.low_3 + POOL.extent_3, strict=True)),
    )
    assert ((inner - inner.mean()) ** 2 / inner.mean()).sum() < 63 + 4.5 * np.sqrt(2 * 63)


@pytest.mark.parametrize("pose", poses()[::3])
def test_outside_queries_are_uniform_outside_the_box(pose):
    queries = outside_queries(POOL, pose, 20_000, np.random.default_rng(6))
    assert queries.points_N3.shape == (20_000, 3)
    assert not queries.occupied_N.any()
    assert not box_of(pose, queries.points_N3).any()
    assert np.abs(queries.points_N3).max() <= 0.5
    axis_A = (np.arange(40) + 0.5) / 40 - 0.5
    lattice_N3 = np.stack(np.meshgrid(axis_A, axis_A, axis_A, indexing="ij"), axis=-1).reshape(-1, 3)
    free = ~box_of(pose, lattice_N3).reshape(8, 5, 8, 5, 8, 5).any(axis=(1, 3, 5))
    cells, _ = np.histogramdd(queries.points_N3, bins=8, range=[(-0.5, 0.5)] * 3)
    expected = 20_000 / 8**3 / (1 - POOL.extent_3.prod() * pose.scale**3)
    assert 100 < free.sum() < 512
    chi2 = ((cells[free] - expected) ** 2 / expected).sum()
    assert abs(chi2 - free.sum()) < 4.5 * np.sqrt(2 * free.sum())


def test_queries_of_a_pool_are_distinct_and_random():
    pose = poses()[0]
    queries = pool_queries(POOL, pose, len(POOL), np.random.default_rng(7))
    assert len(np.unique(queries.points_N3.round(6), axis=0)) > len(POOL) - 5
    assert queries.occupied_N.sum() == POOL.occupied_N.sum()
    again = pool_queries(POOL, pose, 100, np.random.default_rng(7))
    other = pool_queries(POOL, pose, 100, np.random.default_rng(8))
    np.testing.assert_array_equal(
        again.points_N3, pool_queries(POOL, pose, 100, np.random.default_rng(7)).points_N3
    )
    assert (again.points_N3 != other.points_N3).any()


def test_surface_queries_are_close_to_the_posed_surface():
    pool, pose = surface_pool(SHAPE, 2000, np.random.default_rng(9), sigmas=(0.01,)), poses()[5]
    queries = pool_queries(pool, pose, 300, np.random.default_rng(10))
    posed = SHAPE.mesh.copy().apply_transform(pose.rig_from_object)
    surface_N3, _ = trimesh.sample.sample_surface(posed, 20_000, seed=0)
    distance_N = np.linalg.norm(queries.points_N3[:, None] - surface_N3[None], axis=-1).min(axis=1)
    assert distance_N.max() < 5 * 0.01 * pose.scale + 0.01
    clear_N = distance_N > 0.012
    np.testing.assert_array_equal(contains(posed, queries.points_N3[clear_N]), queries.occupied_N[clear_N])


def test_a_pool_that_is_too_small_says_so():
    with pytest.raises(UserError, match="30001 asked from a pool of 30000"):
        pool_queries(POOL, poses()[0], 30_001, np.random.default_rng(0))
    small = box_pool(SHAPE, 100, np.random.default_rng(0))
    with pytest.raises(UserError, match="from a pool of 100"):
        cube_queries(small, poses()[0], 10_000, np.random.default_rng(0))


def test_a_box_that_leaves_the_cube_is_cut():
    pose = Pose(random_rotations(1, np.random.default_rng(4))[0], 1.0, np.array([0.3, 0.1, 0]))
    posed = SHAPE.mesh.copy().apply_transform(pose.rig_from_object)
    assert posed.bounds[1, 0] > 0.6
    queries = cube_queries(POOL, pose, 20_000, np.random.default_rng(0))
    assert np.abs(queries.points_N3).max() <= 0.5
    assert (contains(posed, queries.points_N3) == queries.occupied_N).mean() > 0.999
    cube = trimesh.creation.box((1, 1, 1))
    held = trimesh.boolean.intersection([posed, cube]).volume
    assert queries.occupied_N.mean() == pytest.approx(held, rel=0.05)
    outside = outside_queries(POOL, pose, 500, np.random.default_rng(0)).points_N3
    assert np.abs(outside).max() <= 0.5
    assert not box_of(pose, outside).any()
