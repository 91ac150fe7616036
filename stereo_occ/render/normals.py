"""Vertex normals that keep creases sharp."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from trimesh import Trimesh


def split_at_creases(
    mesh: Trimesh, crease_angle: float
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Split vertices along edges whose faces meet at more than ``crease_angle`` radians.

    The corners of a vertex that are joined by smooth edges share one normal: the mean of their face normals,
    weighted by the corner's angle (Thuermer and Wuethrich, Journal of Graphics Tools 3(1), 1998).

    Returns:
        Which vertex of the mesh each one is ``(V,)``, unit normals ``(V, 3)`` and faces ``(F, 3)``; F is unchanged.
    """
    faces_F3 = mesh.faces
    smooth = mesh.face_adjacency_angles <= crease_angle
    pairs_E2, edges_E2 = mesh.face_adjacency[smooth], mesh.face_adjacency_edges[smooth]
    # The corner, numbered 3 * face + position, of each face of a pair at each end of their common edge.
    position_E22 = (faces_F3[pairs_E2][:, :, None, :] == edges_E2[:, None, :, None]).argmax(-1)
    corner_E22 = 3 * pairs_E2[:, :, None] + position_E22
    links_K2 = corner_E22.transpose(0, 2, 1).reshape(-1, 2)
    corners = 3 * len(faces_F3)
    graph = coo_matrix((np.ones(len(links_K2), bool), tuple(links_K2.T)), shape=(corners, corners))
    count, group_C = connected_components(graph, directed=False)

    weighted_C3 = (mesh.face_angles[:, :, None] * mesh.face_normals[:, None, :]).reshape(-1, 3)
    normals_V3 = np.stack([np.bincount(group_C, weighted_C3[:, axis], count) for axis in range(3)], axis=1)
    length_V1 = np.linalg.norm(normals_V3, axis=1, keepdims=True)
    source_V = np.empty(count, np.int64)
    source_V[group_C] = faces_F3.ravel()
    return source_V, normals_V3 / np.maximum(length_V1, 1e-12), group_C.reshape(-1, 3).astype(np.int64)
