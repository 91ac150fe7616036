"""Points where thin parts and cavities are decided, object frame.

Whole-object IoU hardly notices a missing handle, and a filled bowl looks like an empty one from most sides.
"""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from stereo_occ.occupancy.enclosure import directions
from stereo_occ.occupancy.pools import PointPool
from stereo_occ.shapes.shape import PARTS

#: The metric of each region, and whether its points are occupied.
REGIONS = {"handle_recall": True, "neck_recall": True, "cavity_empty": False}

#: Categories with a cavity that is open to the outside.
OPEN = ("mug", "bowl")

#: An empty point lies in a cavity if the object hides at least this share of all directions from it. In front of a flat
#: or bulging surface it is at most 1/2; within a handle it is a little more.
HIDDEN = 0.65

MOST_POINTS = 4000
_DIRECTIONS = 64


def region_points(category: str, mesh: Trimesh, pool: PointPool) -> dict[str, NDArray[np.float32]]:
    """Points ``(N, 3)`` of each region the object has, from the first points of its box pool.

    Args:
        mesh: the object's solid.
        pool: points uniform in the object's box, with part labels where parts are known.
    """
    points_N3 = pool.points_N3
    regions = {
        "handle_recall": _of_part(pool, "handle") if category == "mug" else _no_points(),
        "neck_recall": _of_part(pool, "neck") if category == "bottle" else _no_points(),
        "cavity_empty": _cavity(mesh, points_N3[~pool.occupied_N][:MOST_POINTS])
        if category in OPEN
        else _no_points(),
    }
    return {name: region_N3 for name, region_N3 in regions.items() if len(region_N3)}


def _no_points() -> NDArray[np.float32]:
    return np.empty((0, 3), np.float32)


def _of_part(pool: PointPool, name: str) -> NDArray[np.float32]:
    return np.asarray(pool.points_N3[pool.part_N == PARTS.index(name)][:MOST_POINTS])


def _cavity(mesh: Trimesh, empty_N3: NDArray[np.float32]) -> NDArray[np.float32]:
    direction_D3 = directions(_DIRECTIONS)
    origins_R3 = np.repeat(empty_N3, _DIRECTIONS, axis=0)
    meets_R = RayMeshIntersector(mesh).intersects_any(origins_R3, np.tile(direction_D3, (len(empty_N3), 1)))
    return np.asarray(empty_N3[meets_R.reshape(-1, _DIRECTIONS).mean(axis=1) >= HIDDEN])
