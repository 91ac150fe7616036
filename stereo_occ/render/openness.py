"""How much of the light from all around reaches a surface, where the object itself is in its way."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

RAYS = 64

#: How far off the surface rays begin, in diagonals of the mesh.
LIFT = 1e-4


def openness(
    mesh: Trimesh, positions_V3: NDArray[np.float64], normals_V3: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share ``(V,)`` of evenly diffuse light that reaches each vertex past ``mesh``, 0 to 1.

    Ambient occlusion (Zhukov et al., "An Ambient Light Illumination Model", 1998): the same rays for every vertex, in
    the frame of its normal, as dense as a matt surface weighs them.

    Args:
        positions_V3: on the mesh's surface.
        normals_V3: unit vectors, or zeros, where all counts as open.
    """
    across_V3 = np.cross(normals_V3, np.eye(3)[np.abs(normals_V3).argmin(axis=1)])
    across_V3 /= np.linalg.norm(across_V3, axis=1, keepdims=True).clip(
        1e-12
    )  # faces without area have no normal
    frames_V33 = np.stack([across_V3, np.cross(normals_V3, across_V3), normals_V3], axis=1)
    starts_V3 = positions_V3 + LIFT * mesh.scale * normals_V3
    rays = RayMeshIntersector(mesh)
    blocked_V = np.zeros(len(positions_V3))
    for direction_3 in _cosine_weighted(RAYS):
        blocked_V += rays.intersects_any(starts_V3, direction_3 @ frames_V33)
    return 1 - blocked_V / RAYS


def _cosine_weighted(count: int) -> NDArray[np.float64]:
    """Directions ``(count, 3)`` about +Z: a sunflower's points in the unit disc, lifted to the sphere."""
    number_R = np.arange(count) + 0.5
    radius_R, turn_R = np.sqrt(number_R / count), np.pi * (3 - np.sqrt(5)) * number_R
    return np.stack([radius_R * np.cos(turn_R), radius_R * np.sin(turn_R), np.sqrt(1 - radius_R**2)], axis=1)
