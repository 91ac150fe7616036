"""Figures that tell whether a solid is a sound household object, and how far it is from another mesh."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from stereo_occ.occupancy.contains import contains
from stereo_occ.occupancy.enclosure import encloses
from stereo_occ.shapes.distance import Surface, spread

#: Cells of the grid that tells cavities, along the longest side.
CAVITY_CELLS = 64
#: Points between which and the other surface the deviation is measured.
DEVIATION_POINTS = 4000
#: Points at which the wall is measured.
WALL_POINTS = 4000


def bodies_and_genus(solid: Trimesh) -> dict[str, float]:
    """``bodies`` and ``genus`` (handles of all bodies together: 1 for a mug, 0 for a bowl)."""
    bodies = int(solid.body_count)
    return {"bodies": bodies, "genus": bodies - solid.euler_number / 2}


def wall_thickness(solid: Trimesh) -> dict[str, float]:
    """``wall_median`` and ``wall_p5``: from the surface straight inward to the other side, share of the diagonal.

    Area-weighted. For a solid without a cavity this is its breadth.
    """
    points_N3, face_N = _evenly(solid, WALL_POINTS)
    inward_N3 = -solid.face_normals[face_N]
    start_N3 = points_N3 + 1e-5 * solid.scale * inward_N3
    hits_H3, ray_H, _ = RayMeshIntersector(solid).intersects_location(
        start_N3, inward_N3, multiple_hits=False
    )
    thickness_H = np.linalg.norm(hits_H3 - points_N3[ray_H], axis=1) / solid.scale
    median, low = np.quantile(thickness_H, [0.5, 0.05]) if len(thickness_H) else (0.0, 0.0)
    return {"wall_median": float(median), "wall_p5": float(low)}


def cavity(solid: Trimesh) -> dict[str, float]:
    """``cavity``: share of the vessel, its content included, that is empty; ``void``: share sealed off from outside.

    Water is poured in with each of the six directions of the axes up; the one that holds most counts. Openings
    narrower than about 3 cells of the grid (5 % of the longest side) count as closed.
    """
    cell = float(solid.extents.max()) / CAVITY_CELLS
    counts = np.ceil(solid.extents / cell).astype(int) + 4
    low_3 = solid.bounds.mean(axis=0) - (counts - 1) / 2 * cell
    filled = contains(solid, low_3 + cell * np.argwhere(np.ones(counts, bool))).reshape(counts)
    walls = filled.copy()
    walls[tuple(np.rint((spread(solid.triangles, cell / 2)[0] - low_3) / cell).astype(int).T)] = True
    held = max(
        (_held(np.moveaxis(walls, axis, 0), way) & ~np.moveaxis(filled, axis, 0)).sum()
        for axis in range(3)
        for way in (1, -1)
    )
    pieces = solid.split(only_watertight=False) if solid.body_count > 1 else [solid]
    void = sum(max(-piece.volume, 0.0) for piece in pieces)
    content = held * cell**3
    return {"cavity": float(content / (content + solid.volume)), "void": float(void / (void + solid.volume))}


def deviation(source: Trimesh, solid: Trimesh) -> dict[str, float]:
    """Distances between two surfaces as shares of the source's diagonal.

    ``lost_*`` from the source to the solid (what the solid lacks), ``gained_*`` the other way round; mean,
    95th and 99th percentile over points spread evenly by area. Source surface with the source's own inside on both
    sides, as where a handle's end sticks in the wall, is no loss and does not count.
    """
    figures: dict[str, float] = {}
    for name, origin, target in (("lost", source, solid), ("gained", solid, source)):
        points_N3, face_N = _evenly(origin, DEVIATION_POINTS)
        distance_N = Surface(target, source.scale / 200).distance(points_N3, candidates=8)[0] / source.scale
        if name == "lost":
            far_M = np.flatnonzero(distance_N > 1e-3)
            step_M3 = 1e-3 * source.scale * origin.face_normals[face_N[far_M]]
            absorbed_M = encloses(source, points_N3[far_M] + step_M3) & encloses(
                source, points_N3[far_M] - step_M3
            )
            distance_N = np.delete(distance_N, far_M[absorbed_M])
        p95, p99 = np.quantile(distance_N, [0.95, 0.99]) if len(distance_N) else (0.0, 0.0)
        figures |= {
            f"{name}_mean": float(distance_N.mean()),
            f"{name}_p95": float(p95),
            f"{name}_p99": float(p99),
        }
    return figures


def _held(walls: NDArray[np.bool_], way: int) -> NDArray[np.bool_]:
    """Cells that hold water, the first axis pointing up (or down), and those in the walls next to them."""
    upright = walls[::way]
    held = np.zeros_like(upright)
    for level in range(1, len(upright)):
        regions, _ = ndimage.label(~upright[: level + 1])
        held[level] = ~upright[level] & (regions[level] != regions[0, 0, 0])
    grown: NDArray[np.bool_] = ndimage.maximum_filter(held, 3)[::way]
    return grown & walls | held[::way]


def _evenly(mesh: Trimesh, count: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """About ``count`` points spread evenly by area, at least one on each triangle's row, and their triangles."""
    area_F = mesh.area_faces
    total_F = np.cumsum(area_F)
    face_N = np.searchsorted(total_F, (np.arange(count) + 0.5) / count * total_F[-1]).clip(
        max=len(area_F) - 1
    )
    # R2 low-discrepancy sequence, folded into the triangle
    u_N, v_N = (np.arange(1, count + 1)[:, None] * [0.7548776662466927, 0.5698402909980532] % 1).T
    fold_N = u_N + v_N > 1
    u_N, v_N = np.where(fold_N, 1 - u_N, u_N), np.where(fold_N, 1 - v_N, v_N)
    a_N3, b_N3, c_N3 = mesh.triangles[face_N].transpose(1, 0, 2)
    return a_N3 + u_N[:, None] * (b_N3 - a_N3) + v_N[:, None] * (c_N3 - a_N3), face_N
