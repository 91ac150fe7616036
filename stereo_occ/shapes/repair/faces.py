"""The gentlest repairs: they move no vertex farther than the weld's tolerance and invent no surface."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh


def weld(mesh: Trimesh) -> tuple[Trimesh, bool]:
    """The mesh with vertices at the same place merged and collapsed faces dropped; whether any were."""
    welded = Trimesh(mesh.vertices, mesh.faces, process=False)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    welded.update_faces(_spans_area(welded.faces))
    welded.remove_unreferenced_vertices()
    changed = len(welded.vertices) != len(mesh.vertices) or len(welded.faces) != len(mesh.faces)
    return (welded if changed else Trimesh(mesh.vertices, mesh.faces, process=False)), changed


def _spans_area(faces_F3: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Faces with three different corners."""
    spans_F: NDArray[np.bool_] = np.all(np.diff(np.sort(faces_F3, axis=1), axis=1) > 0, axis=1)
    return spans_F
