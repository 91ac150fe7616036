"""Meshes with fewer faces: closed, and where they were."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from stereo_occ.mesh_output import simplified

#: A bowl's: a ball's outside of 50 mm, an inside of 46 mm, cut in half; metres.
OUTSIDE, INSIDE = 0.05, 0.046


@pytest.fixture(scope="module")
def bowl():
    outside, inside = (trimesh.creation.icosphere(subdivisions=5, radius=r) for r in (OUTSIDE, INSIDE))
    below = trimesh.creation.box((1, 1, 1)).apply_translation([0, 0, -0.5])
    return trimesh.boolean.intersection([trimesh.boolean.difference([outside, inside]), below])


@pytest.mark.parametrize("tolerance", [1e-4, 5e-4, 2e-3, 5e-3])
def test_nothing_is_farther_than_the_tolerance(bowl, tolerance):
    simple = simplified(bowl, tolerance)
    assert simple.is_volume
    assert len(simple.faces) < 0.7 * len(bowl.faces)
    points_N3, _ = trimesh.sample.sample_surface(simple, 20_000, seed=0)
    radius_N, up_N = np.linalg.norm(points_N3, axis=1), points_N3[:, 2]
    to_shells_N = np.minimum(abs(radius_N - OUTSIDE), abs(radius_N - INSIDE))
    on_rim_N = np.maximum.reduce([INSIDE - radius_N, radius_N - OUTSIDE, abs(up_N)])
    facets = 2e-5  # between the ball and the mesh's flat faces
    assert np.minimum(to_shells_N, on_rim_N).max() < tolerance + facets
    # The way back: each corner to the nearest of many points on what is left.
    dense_N3, _ = trimesh.sample.sample_surface(simple, 400_000, seed=1)
    from_corners_V, _ = cKDTree(dense_N3).query(bowl.vertices)
    assert from_corners_V.max() < tolerance + 4e-4


def test_volumes_hold_where_the_tolerance_is_below_the_wall(bowl):
    assert simplified(bowl, 1e-3).volume == pytest.approx(bowl.volume, rel=0.03)


def test_a_mesh_that_is_not_closed_is_left_as_it_is():
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.update_faces(np.arange(len(ball.faces)) > 3)
    assert simplified(ball, 0.1) is ball
