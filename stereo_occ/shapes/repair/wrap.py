"""A closed surface around a broken one: the last resort, which makes the mesh anew."""

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes
from trimesh import Trimesh

from stereo_occ.occupancy.enclosure import encloses
from stereo_occ.shapes.distance import Surface
from stereo_occ.shapes.repair.topology import pieces

#: Cells of the grid along the box's diagonal.
CELLS = 256
#: Holes and gaps narrower than twice this many cells are closed.
REACH = 1.5
#: Thickness that a sheet without any gets, as a share of the box's diagonal.
SHEET = 0.015
#: Bodies and voids of less volume, as a share of the diagonal's cube, are artefacts of the grid.
CRUMB = 5e-6


def wrap(mesh: Trimesh) -> tuple[Trimesh, float]:
    """The solid that a broken surface bounds, and the share of the surface that was a sheet without thickness.

    Space farther from the surface than a small reach falls into regions. Those connected to the outside are
    empty, and so are those that the surface does not enclose (sealed voids); the rest is solid. Closer to the
    surface, what a ball of that radius fits into without leaving the empty regions' surroundings is empty (a
    morphological closing): the surface stays in its place, and holes narrower than about 1 % of the
    diagonal are closed. A sheet with empty space on both sides gets the thickness :data:`SHEET`, so an open cup
    stays hollow. The same mesh gives the same bytes.
    """
    cell = float(mesh.scale) / CELLS
    reach, half_sheet = REACH * cell, SHEET * mesh.scale / 2
    surface = Surface(mesh, cell / 2)
    low_3 = mesh.bounds[0] - (half_sheet + 4 * cell)
    high_3 = mesh.bounds[1] + (half_sheet + 4 * cell)
    crossed = np.zeros(np.ceil((high_3 - low_3) / cell).astype(int), bool)
    crossed[tuple(np.rint((surface.points_S3 - low_3) / cell).astype(int).T)] = True
    near = _grown(crossed, int(np.ceil(max(reach, half_sheet) / cell + 1)))

    distance_N, nearest_N = surface.distance(low_3 + cell * np.argwhere(near))
    distance = np.full(near.shape, 2 * reach)
    distance[near] = distance_N.clip(max=2 * reach)
    empty = _empty(mesh, distance > reach, low_3, cell)
    depth = _depth(np.where((distance > reach) & ~empty, 0, distance), empty, reach, cell)
    sheet_S = _without_thickness(mesh, surface, empty, low_3, cell)
    thick_N = np.where(sheet_S[nearest_N], half_sheet - distance_N, -reach).clip(max=reach)
    depth[near] = np.maximum(depth[near], thick_N)
    return _extract(depth, low_3, cell), float(sheet_S.mean())


def _grown(mask: NDArray[np.bool_], cells: int) -> NDArray[np.bool_]:
    """The mask and all cells within a cube of that half-side around each."""
    grown: NDArray[np.bool_] = ndimage.maximum_filter(mask, 2 * cells + 1)
    return grown


def _empty(
    mesh: Trimesh, away: NDArray[np.bool_], low_3: NDArray[np.float64], cell: float
) -> NDArray[np.bool_]:
    """Cells away from the surface that belong to no solid."""
    regions, count = ndimage.label(away)
    outside = regions[0, 0, 0]
    sizes = np.bincount(regions.ravel(), minlength=count + 1)
    inner = [label for label in range(1, count + 1) if label != outside and sizes[label] >= 8]
    voids: list[int] = []
    if inner:
        depth = ndimage.distance_transform_edt(away)
        deepest = np.array(ndimage.maximum_position(depth, regions, inner))
        voids = list(np.array(inner)[~encloses(mesh, low_3 + cell * deepest)])
    empty: NDArray[np.bool_] = np.isin(regions, [outside, *voids])
    return empty


def _depth(
    distance: NDArray[np.float64], empty: NDArray[np.bool_], reach: float, cell: float
) -> NDArray[np.float64]:
    """Distance from the empty regions' edge, less the reach: > 0 in the solid."""
    depth = np.where(empty, -reach, reach)
    edge_V3, _, _, _ = marching_cubes(distance, level=reach)
    band = ~empty & (distance > 0) & (distance <= reach)
    depth[band] = cKDTree(edge_V3).query(np.argwhere(band))[0] * cell - reach
    return depth


def _without_thickness(
    mesh: Trimesh, surface: Surface, empty: NDArray[np.bool_], low_3: NDArray[np.float64], cell: float
) -> NDArray[np.bool_]:
    """Which of the surface's points have empty space before and behind them, or lie beside such points.

    The others are there for edges, where one sheet stands in the space before another.
    """
    offset_S3 = (REACH + 1.2) * cell * mesh.face_normals[surface.face_S]
    free_S = np.ones(len(offset_S3), bool)
    for side in (-1, 1):
        cell_S3 = np.rint((surface.points_S3 + side * offset_S3 - low_3) / cell).astype(int)
        free_S &= empty[tuple(cell_S3.clip(0, np.array(empty.shape) - 1).T)]
    if not free_S.any():
        return free_S
    tree = cKDTree(surface.points_S3[free_S])
    distance_S, _ = tree.query(surface.points_S3, distance_upper_bound=(REACH + 2.5) * cell)
    beside_S: NDArray[np.bool_] = np.isfinite(distance_S)
    return beside_S


def _extract(depth: NDArray[np.float64], low_3: NDArray[np.float64], cell: float) -> Trimesh:
    """The surface where the depth changes its sign, outward, with no more triangles than its shape needs."""
    depth[np.abs(depth) < 1e-3 * cell] = -1e-3 * cell  # no vertices on grid points, where triangles collapse
    vertices_V3, faces_F3, _, _ = marching_cubes(depth, level=0, gradient_direction="ascent")
    solid = Manifold(Mesh64(low_3 + cell * vertices_V3.astype(float), faces_F3.astype(np.uint64)))
    solid = solid.simplify(0.05 * cell)
    result = solid.to_mesh64()
    wrapped = Trimesh(result.vert_properties[:, :3], result.tri_verts.astype(int), process=False)
    found = [Trimesh(wrapped.vertices, piece_P3, process=False) for piece_P3 in pieces(wrapped.faces)]
    large = [piece.faces for piece in found if abs(piece.volume) > CRUMB * (CELLS * cell) ** 3]
    wrapped = Trimesh(wrapped.vertices, np.concatenate(large or [wrapped.faces]), process=False)
    wrapped.remove_unreferenced_vertices()
    return wrapped
