"""Finished meshes: fewer faces where the surface is flat, and files."""

from pathlib import Path
from typing import Any

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.shapes.distance import Surface
from stereo_occ.writing import write_whole

#: Endings of the files that can be written.
FORMATS = (".glb", ".obj", ".ply", ".stl")


#: Tolerances that :func:`simplified` tries, as shares of the one asked for: what manifold3d collapses to one is up to
#: 2.1 times as far, and farther where the tolerance is a wall's thickness.
SHARES = (0.45, 0.3, 0.15)

#: Nearest points whose triangles are looked at for a distance, at first and where that seems too far.
CANDIDATES = (4, 64)


def simplified(mesh: Trimesh, tolerance: float) -> Trimesh:
    """Fewer faces, each of the two surfaces nowhere farther than ``tolerance`` from the other; closed as before.

    Measured at points of both, about as far apart as the corners of the mesh.
    """
    spacing = max(tolerance, float(np.median(mesh.edges_unique_length)))
    whole = Surface(mesh, spacing)
    points_N3 = np.concatenate([mesh.vertices, mesh.triangles_center])
    for share in SHARES:
        simple = collapsed(mesh, share * tolerance)
        kept = Surface(simple, spacing)
        if _within(tolerance, kept, points_N3) and _within(tolerance, whole, kept.points_S3):
            return simple
    return mesh


def _within(tolerance: float, surface: Surface, points_N3: NDArray[np.float64]) -> bool:
    """Whether no point ``(N, 3)`` is farther from the surface."""
    for candidates in CANDIDATES:
        points_N3 = points_N3[surface.distance(points_N3, candidates)[0] > tolerance]
    return not len(points_N3)


def collapsed(mesh: Trimesh, tolerance: float) -> Trimesh:
    """Short edges collapsed by manifold3d, the surface about ``tolerance`` from where it was; closed as before.

    A mesh that manifold3d does not take is returned as it is.
    """
    # Copies: manifold3d takes no arrays that are read-only.
    solid = Manifold(Mesh64(np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.uint64)))
    if solid.status() != Error.NoError or solid.is_empty():
        return mesh
    simple = solid.simplify(tolerance).to_mesh64()
    result = Trimesh(
        np.asarray(simple.vert_properties)[:, :3], simple.tri_verts.astype(np.int64), process=False
    )
    return result if len(result.faces) and result.is_volume else mesh


def few_faces(mesh: Trimesh, most: int) -> Trimesh:
    """A mesh for show with at most ``most`` faces: collapsed as far as that needs, at first by 0.05 % of its size.

    What :func:`collapsed` does not take, vertices of one cell of a grid become one, so it may not stay closed.
    """
    size = float(np.max(mesh.extents))
    for share in 0.0005 * 2.0 ** np.arange(6):
        if len(mesh.faces) <= most:
            return mesh
        mesh = collapsed(mesh, share * size)
    cells = 128.0
    merged = mesh
    while len(merged.faces) > most:
        cell_V3 = np.floor((mesh.vertices - mesh.bounds[0]) / size * cells).astype(np.int64)
        _, first_C, cell_V = np.unique(cell_V3, axis=0, return_index=True, return_inverse=True)
        merged = Trimesh(mesh.vertices[first_C], cell_V.reshape(-1)[mesh.faces], process=False)
        merged.update_faces(merged.nondegenerate_faces() & merged.unique_faces())
        merged.remove_unreferenced_vertices()
        cells /= 2**0.5
    return merged


def write_mesh(mesh: Trimesh, path: Path) -> None:
    """Write GLB, OBJ, PLY or STL, with normals and colours where the format has them; whole or not at all.

    Raises:
        UserError: the folder cannot be written.
    """
    kind = path.suffix.lower().lstrip(".")
    options: dict[str, Any] = {
        "glb": {"include_normals": True},
        "obj": {"include_normals": True},
        "ply": {"vertex_normal": True},
    }
    data = mesh.export(file_type=kind, **options.get(kind, {}))
    write_whole(path, data if isinstance(data, bytes) else str(data).encode())
