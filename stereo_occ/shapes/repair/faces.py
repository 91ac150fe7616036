"""The gentlest repairs: they move no vertex farther than a tolerance and invent no surface."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.shapes.repair.topology import Faces, edge_keys, is_closed, pieces

#: Vertices this far apart, as shares of the diagonal, are tried as one where exact welding leaves open edges.
TOLERANCES = (1e-6, 1e-5, 1e-4, 5e-4)


def weld(mesh: Trimesh) -> tuple[Trimesh, bool]:
    """The mesh with vertices at the same place merged, collapsed faces and unused vertices dropped.

    Also tells whether there were any; otherwise vertices and faces stay as they are, to the byte.
    """
    welded = Trimesh(mesh.vertices, mesh.faces, process=False)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    welded = _with_faces(welded, _spanning(welded.faces))
    if len(welded.vertices) == len(mesh.vertices) and len(welded.faces) == len(mesh.faces):
        return Trimesh(mesh.vertices, mesh.faces, process=False), False
    return welded, True


def weld_loosely(mesh: Trimesh) -> tuple[Trimesh, float]:
    """The mesh with nearby vertices merged if that closes it, and the smallest distance that does (or 0).

    ``mesh`` is welded, its diagonal is 1.
    """
    for tolerance in TOLERANCES if not is_closed(mesh.faces) else ():
        _, first_U, group_V = np.unique(
            np.rint(mesh.vertices / tolerance), axis=0, return_index=True, return_inverse=True
        )
        faces_F3 = _spanning(first_U[group_V.ravel()][mesh.faces])
        if is_closed(faces_F3):
            return _with_faces(mesh, faces_F3), tolerance
    return mesh, 0.0


def drop_doubled(mesh: Trimesh) -> tuple[Trimesh, int]:
    """The mesh with at most one face on any three vertices, and how many faces went.

    Back-to-back copies are a sheet with two sides, of which one stays, or a flap on an otherwise closed surface,
    which goes: a patch of doubled faces goes if most of its border runs along edges that other faces close.
    """
    _, first_U, group_F, count_U = np.unique(
        np.sort(mesh.faces, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    if count_U.max() == 1:
        return mesh, 0
    single_F3 = mesh.faces[count_U[group_F.ravel()] == 1]
    closed = _Closing(single_F3)
    patches = pieces(mesh.faces[np.sort(first_U[count_U > 1])])
    faces_F3 = np.concatenate(
        [single_F3, *(patch_P3 for patch_P3 in patches if not closed.without(patch_P3))]
    )
    return _with_faces(mesh, faces_F3), len(mesh.faces) - len(faces_F3)


class _Closing:
    """The edges of a set of faces."""

    def __init__(self, faces_F3: Faces) -> None:
        self._keys_E, self._uses_E = np.unique(edge_keys(faces_F3), return_counts=True)

    def without(self, patch_P3: Faces) -> bool:
        """Whether most of the patch's border edges have two faces already."""
        keys_E, uses_E = np.unique(edge_keys(patch_P3), return_counts=True)
        border_B = keys_E[uses_E == 1]
        if not len(self._keys_E) or not len(border_B):
            return False
        place_B = np.searchsorted(self._keys_E, border_B).clip(max=len(self._keys_E) - 1)
        uses_B = np.where(self._keys_E[place_B] == border_B, self._uses_E[place_B], 0)
        return bool((uses_B == 2).sum() > (uses_B == 1).sum())


def _spanning(faces_F3: NDArray[np.integer]) -> Faces:
    """The faces with three different corners."""
    return np.asarray(faces_F3[np.all(np.diff(np.sort(faces_F3, axis=1), axis=1) > 0, axis=1)], np.int64)


def _with_faces(mesh: Trimesh, faces_F3: NDArray[np.integer]) -> Trimesh:
    result = Trimesh(mesh.vertices, faces_F3, process=False)
    result.remove_unreferenced_vertices()
    return result
