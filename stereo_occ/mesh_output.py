"""Finished meshes: fewer faces where the surface is flat, and files."""

from pathlib import Path
from typing import Any

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from trimesh import Trimesh

from stereo_occ.writing import write_whole

#: Endings of the files that can be written.
FORMATS = (".glb", ".obj", ".ply", ".stl")


def simplified(mesh: Trimesh, tolerance: float) -> Trimesh:
    """Fewer faces, the surface nowhere farther than ``tolerance`` from where it was; closed as before.

    Edges are collapsed by manifold3d, which keeps a closed surface closed. A mesh that it does not take is returned
    as it is.
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
    """A mesh for show with at most ``most`` faces: simplified as far as that needs, at first by 0.05 % of its size.

    What :func:`simplified` does not take, vertices of one cell of a grid become one, so it may not stay closed.
    """
    size = float(np.max(mesh.extents))
    for share in 0.0005 * 2.0 ** np.arange(6):
        if len(mesh.faces) <= most:
            return mesh
        mesh = simplified(mesh, share * size)
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
