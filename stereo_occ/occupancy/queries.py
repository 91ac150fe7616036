"""Query points of one view, in the rig frame, from an object's point pools and its pose there."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.geometry.pose import Pose
from stereo_occ.occupancy.pools import PointPool, lattice_points

_HALF = 0.5  # the working volume is the cube [-0.5, 0.5]^3 of the rig frame


@dataclass(frozen=True, eq=False)
class LabelledPoints:
    """Points ``(N, 3)`` and whether the object contains them ``(N,)``."""

    points_N3: NDArray[np.floating]
    occupied_N: NDArray[np.bool_]


def pool_queries(pool: PointPool, pose: Pose, count: int, rng: np.random.Generator) -> LabelledPoints:
    """``count`` distinct points of a pool, posed; of a box pool, the paper's query points.

    Raises:
        UserError: if the pool has fewer points.
    """
    _check_count(count, len(pool))
    return _posed(pool, pose, rng.choice(len(pool), count, replace=False))


def cube_queries(pool: PointPool, pose: Pose, count: int, rng: np.random.Generator) -> LabelledPoints:
    """``count`` points uniform in the working volume, with the labels of a box pool.

    Outside the object's posed box a point is empty. Points inside it are replaced by as many distinct points
    of the pool, posed, that are in the volume: they too are uniform in what it has of the box, and their labels are
    known.

    Raises:
        UserError: if the pool has too few points.
    """
    points_N3 = rng.uniform(-_HALF, _HALF, (count, 3))
    inside_N, whole = _in_box(points_N3, pool, pose)
    drawn = (pool_queries if whole else _draw_within)(pool, pose, int(inside_N.sum()), rng)
    points_N3[inside_N] = drawn.points_N3
    occupied_N = np.zeros(count, dtype=bool)
    occupied_N[inside_N] = drawn.occupied_N
    return LabelledPoints(points_N3, occupied_N)


def outside_queries(pool: PointPool, pose: Pose, count: int, rng: np.random.Generator) -> LabelledPoints:
    """``count`` points uniform in the working volume without the box of a box pool, posed: all empty."""
    points_N3 = np.empty((0, 3))
    while len(points_N3) < count:  # a box with diagonal 1 fills at most a fifth of the cube
        candidates_M3 = rng.uniform(-_HALF, _HALF, (count, 3))
        inside_M, _ = _in_box(candidates_M3, pool, pose)
        points_N3 = np.concatenate([points_N3, candidates_M3[~inside_M]])
    return LabelledPoints(points_N3[:count], np.zeros(count, dtype=bool))


def _draw_within(pool: PointPool, pose: Pose, count: int, rng: np.random.Generator) -> LabelledPoints:
    """``count`` distinct points of those of the pool, posed, that are in the working volume."""
    all_points = _posed(pool, pose, rng.permutation(len(pool)))
    (within_M,) = (np.abs(all_points.points_N3) <= _HALF).all(axis=1).nonzero()
    _check_count(count, len(within_M))
    return LabelledPoints(all_points.points_N3[within_M[:count]], all_points.occupied_N[within_M[:count]])


def _posed(pool: PointPool, pose: Pose, index_M: NDArray[np.int64]) -> LabelledPoints:
    points_M3 = lattice_points(pool.grid_N3[index_M], pool.low_3, pool.extent_3)
    return LabelledPoints(pose.to_rig(points_M3), pool.occupied_N[index_M])


def _check_count(count: int, available: int) -> None:
    if count > available:
        raise UserError(
            f"query points: {count} asked from a pool of {available}; ask for fewer or prepare a larger pool"
        )


def _in_box(points_N3: NDArray[np.float64], pool: PointPool, pose: Pose) -> tuple[NDArray[np.bool_], bool]:
    """Which rig-frame points lie in the pool's posed box, and whether the working volume holds the whole box."""
    high_3 = pool.low_3 + pool.extent_3
    corners_83 = pose.to_rig(np.array(list(product(*zip(pool.low_3, high_3, strict=True)))))
    object_N3 = pose.to_object(points_N3)
    inside_N = np.asarray(((object_N3 > pool.low_3) & (object_N3 < high_3)).all(axis=1))
    return inside_N, bool(np.abs(corners_83).max() <= _HALF + 1e-6)
