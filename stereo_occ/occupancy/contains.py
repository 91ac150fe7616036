"""Which points lie inside a closed surface."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from stereo_occ.errors import UserError
from stereo_occ.occupancy.enclosure import overlap

#: Points at which a mesh is tried for overlapping itself.
OVERLAP_POINTS = 4000

# Irrational components: no ray runs along the axes, diagonals or lattice planes that meshes are made of.
# A float32 ray that meets an edge may still be miscounted, but hardly along two unrelated directions.
_DIRECTIONS_33 = np.array(
    [
        [1 / sqrt(2), 1 / sqrt(3), 1 / sqrt(6)],
        [-sqrt(5) / 5, sqrt(11) / 5, -3 / 5],
        [sqrt(7) / 6, -sqrt(3) / 6, -sqrt(26) / 6],
    ]
)


def contains(mesh: Trimesh, points_N3: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Inside or outside a closed mesh, for points ``(N, 3)`` in the mesh's frame; ``(N,)`` booleans.

    The first face that a ray meets tells by its side where the ray began, if no parts of the solid overlap.
    Two rays along unrelated directions are asked. Where they disagree, and for all points of a mesh that
    overlaps itself, rays are followed to the end: exits minus entries are the winding number of the surface about the
    point, and a third direction decides where two disagree. Rays are cast with Embree (float32). Points closer
    to the surface than 1e-6 of the box's diagonal may go either way.

    Raises:
        UserError: if the mesh is not closed with outward faces, or a point is not finite.
    """
    if not mesh.is_volume:
        raise UserError(
            "mesh: inside and outside need a closed surface with outward faces, got "
            f"watertight={mesh.is_watertight}, consistent winding={mesh.is_winding_consistent}, "
            f"volume={mesh.volume:.3g}; repair the mesh first"
        )
    finite_N = np.isfinite(points_N3).all(axis=1)
    if not finite_N.all():
        raise UserError(f"points: must be finite, got {np.count_nonzero(~finite_N)} that are not")
    low_3, high_3 = mesh.bounds
    inside_N: NDArray[np.bool_] = ((points_N3 > low_3) & (points_N3 < high_3)).all(axis=1)
    candidates_M3 = points_N3[inside_N]
    rays = RayMeshIntersector(mesh)
    if overlap(mesh, rays, OVERLAP_POINTS) > 0:
        inside_M = _by_winding(mesh, rays, candidates_M3)
    else:
        inside_M, other_M = (
            _by_first_face(mesh, rays, candidates_M3, direction_3) for direction_3 in _DIRECTIONS_33[:2]
        )
        unsure_M = inside_M != other_M
        inside_M[unsure_M] = _by_winding(mesh, rays, candidates_M3[unsure_M])
    inside_N[inside_N] = inside_M
    return inside_N


def _by_first_face(
    mesh: Trimesh, rays: RayMeshIntersector, points_N3: NDArray[np.floating], direction_3: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether the first face that rays ``(N,)`` along ``direction_3`` meet is met from inside."""
    face_H, ray_H = rays.intersects_id(
        points_N3, np.broadcast_to(direction_3, points_N3.shape), multiple_hits=False
    )
    inside_N = np.zeros(len(points_N3), bool)
    inside_N[ray_H] = (mesh.face_normals @ direction_3 > 0)[face_H]
    return inside_N


def _by_winding(
    mesh: Trimesh, rays: RayMeshIntersector, points_N3: NDArray[np.floating]
) -> NDArray[np.bool_]:
    """Whether rays ``(N,)`` along two directions leave the surface more often than they enter it."""
    inside_N, other_N = (_encloses(mesh, rays, points_N3, direction_3) for direction_3 in _DIRECTIONS_33[:2])
    unsure_N = inside_N != other_N
    inside_N[unsure_N] = _encloses(mesh, rays, points_N3[unsure_N], _DIRECTIONS_33[2])
    return inside_N


def _encloses(
    mesh: Trimesh, rays: RayMeshIntersector, points_N3: NDArray[np.floating], direction_3: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether rays ``(N,)`` along ``direction_3`` leave the surface more often than they enter it."""
    face_H, ray_H = rays.intersects_id(points_N3, np.broadcast_to(direction_3, points_N3.shape))
    exits_H = np.sign(mesh.face_normals[face_H] @ direction_3)
    encloses_N: NDArray[np.bool_] = np.bincount(ray_H, weights=exits_H, minlength=len(points_N3)) > 0.5
    return encloses_N
