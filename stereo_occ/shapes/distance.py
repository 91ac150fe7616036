"""Distance of points from a surface, open or closed."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from trimesh import Trimesh
from trimesh.triangles import closest_point


class Surface:
    """Points spread evenly over a mesh, to answer how far any point is from it.

    Attributes:
        points_S3: the mesh's triangles never lie farther than about ``spacing`` from one of them.
        face_S: the triangle of each point.
    """

    def __init__(self, mesh: Trimesh, spacing: float) -> None:
        self.triangles_F33 = np.asarray(mesh.triangles)
        self.points_S3, self.face_S = spread(self.triangles_F33, spacing)
        self._tree = cKDTree(self.points_S3, balanced_tree=False, compact_nodes=False)

    def distance(
        self, points_N3: NDArray[np.floating], candidates: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Distances ``(N,)`` to the surface, and the index of the nearest spread point.

        The nearest of the triangles of so many nearest spread points counts: exact where it is the nearest of all
        triangles, else too far by a fraction of the spacing.
        """
        points_N3 = np.asarray(points_N3, float)
        nearest_NK = self._tree.query(points_N3, k=list(range(1, candidates + 1)))[1]
        distance_N = np.full(len(points_N3), np.inf)
        for part in np.array_split(np.arange(len(points_N3)), len(points_N3) // 100_000 + 1):
            for nearest_P in nearest_NK[part].T:
                triangles_P33 = self.triangles_F33[self.face_S[nearest_P]]
                distance_N[part] = np.fmin(distance_N[part], _to_triangles(points_N3[part], triangles_P33))
        return distance_N, nearest_NK[:, 0]


def _to_triangles(
    points_N3: NDArray[np.floating], triangles_N33: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Distance ``(N,)`` of each point to its triangle, each in units of the triangle's size.

    trimesh compares areas squared with a constant, so triangles of a millimetre in metres would have no inside.
    """
    origin_N3 = triangles_N33[:, 0]
    size_N = np.ptp(triangles_N33, axis=1).max(axis=1)
    size_N1 = np.where(size_N > 0, size_N, 1.0)[:, None]
    local_N3 = (points_N3 - origin_N3) / size_N1
    foot_N3 = closest_point((triangles_N33 - origin_N3[:, None]) / size_N1[:, None], local_N3)
    return np.asarray(np.linalg.norm(local_N3 - foot_N3, axis=1) * size_N1[:, 0])


def spread(
    triangles_F33: NDArray[np.floating], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Points at most ``spacing`` apart on every triangle, and the triangle of each: ``(S, 3)``, ``(S,)``.

    Each triangle is crossed by rows parallel to its longest side, so slender ones cost no more than others.
    """
    lengths_F3 = np.linalg.norm(np.roll(triangles_F33, -1, axis=1) - triangles_F33, axis=2)
    order_F3 = (lengths_F3.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a_F3, b_F3, c_F3 = np.take_along_axis(triangles_F33, order_F3[:, :, None], axis=1).transpose(1, 0, 2)
    longest_F = lengths_F3.max(axis=1)
    doubled_area_F = np.linalg.norm(np.cross(b_F3 - a_F3, c_F3 - a_F3), axis=1)
    height_F = np.divide(doubled_area_F, longest_F, out=np.zeros_like(longest_F), where=longest_F > 0)

    rows_F = np.ceil(height_F / spacing).astype(int) + 1
    face_R = np.repeat(np.arange(len(rows_F)), rows_F)
    up_R = _ranks(rows_F) / np.maximum(rows_F - 1, 1)[face_R]
    columns_R = np.ceil(longest_F[face_R] * (1 - up_R) / spacing).astype(int) + 1
    row_S = np.repeat(np.arange(len(face_R)), columns_R)
    along_S1 = (_ranks(columns_R) / np.maximum(columns_R - 1, 1)[row_S])[:, None]
    face_S, up_S1 = face_R[row_S], up_R[row_S, None]
    base_S3 = a_F3[face_S] * (1 - along_S1) + b_F3[face_S] * along_S1
    return base_S3 * (1 - up_S1) + c_F3[face_S] * up_S1, face_S


def _ranks(counts_N: NDArray[np.integer]) -> NDArray[np.intp]:
    """0, 1, ... within each group of the given sizes, one group after the other."""
    starts_N = np.cumsum(counts_N) - counts_N
    ranks_N: NDArray[np.intp] = np.arange(counts_N.sum()) - np.repeat(starts_N, counts_N)
    return ranks_N
