"""Which part of a surface a pair of cameras sees."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

#: Relative to the distance from camera to point; Embree works in single precision.
_TOLERANCE = 1e-4


def visible(
    mesh: Trimesh, points_N3: NDArray[np.float64], centers_C3: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Points ``(N,)`` on a closed surface that at least one of the optical centres ``(C, 3)`` sees, all in one frame.

    The edges of the images are not considered: objects are whole in both.
    """
    rays = RayMeshIntersector(mesh)
    seen_N = np.zeros(len(points_N3), bool)
    for center_3 in centers_C3:
        towards_N3 = points_N3 - center_3
        origin_N3 = np.broadcast_to(center_3, points_N3.shape)
        hit_H3, ray_H, _ = rays.intersects_location(origin_N3, towards_N3, multiple_hits=False)
        reach_H = np.linalg.norm(hit_H3 - center_3, axis=1) / np.linalg.norm(towards_N3[ray_H], axis=1)
        unobstructed_N = np.ones(len(points_N3), bool)  # a ray that meets nothing grazed the point's own edge
        unobstructed_N[ray_H] = reach_H > 1 - _TOLERANCE
        seen_N |= unobstructed_N
    return seen_N
