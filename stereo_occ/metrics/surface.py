"""Distances between two surfaces from points spread over both: Chamfer-L1, normal consistency, F-score.

Defined as by Mescheder et al. (Occupancy Networks, CVPR 2019) and Tatarchenko et al. (What do single-view 3D
reconstruction networks learn?, CVPR 2019). Lengths are in units of the rig frame, in which the working cube has side 1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from trimesh import Trimesh

#: Distances at which the F-score is measured: 1 % and 2 % of the unit diagonal.
F_DISTANCES = {"f_score_1": 0.01, "f_score_2": 0.02}

#: Chamfer-L1 of a mesh that is not there: the diagonal of the working cube.
CUBE_DIAGONAL = 3**0.5


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on a surface ``(N, 3)`` and the surface's unit normals there ``(N, 3)``."""

    points_N3: NDArray[np.float64]
    normals_N3: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Correspondence:
    """From each point of one surface to the nearest of another: distance and absolute cosine of their normals."""

    distance_N: NDArray[np.float64]
    cosine_N: NDArray[np.float64]


def surface_points(mesh: Trimesh, count: int, rng: np.random.Generator) -> SurfacePoints:
    """``count`` points uniform by area, one in each of as many strata of equal area.

    They come in the order of the faces, so neighbours are near each other: trees answer them several times faster.

    Raises:
        ValueError: the mesh has no area.
    """
    area_F = np.asarray(mesh.area_faces)
    if not area_F.sum() > 0:
        raise ValueError("a mesh without area has no points on its surface")
    strata_N = (np.arange(count) + rng.random(count)) / count
    below_F = np.cumsum(area_F) / area_F.sum()
    face_N = np.minimum(np.searchsorted(below_F, strata_N, side="right"), len(area_F) - 1)
    face_N = np.where(area_F[face_N] > 0, face_N, int(area_F.argmax()))
    u_N, v_N = rng.random((2, count))
    folded_N = u_N + v_N > 1
    u_N, v_N = np.where(folded_N, 1 - u_N, u_N), np.where(folded_N, 1 - v_N, v_N)
    a_N3, b_N3, c_N3 = np.asarray(mesh.triangles)[face_N].transpose(1, 0, 2)
    points_N3 = a_N3 + u_N[:, None] * (b_N3 - a_N3) + v_N[:, None] * (c_N3 - a_N3)
    normals_N3 = np.cross(b_N3 - a_N3, c_N3 - a_N3)
    return SurfacePoints(points_N3, normals_N3 / np.linalg.norm(normals_N3, axis=1, keepdims=True))


def correspond(source: SurfacePoints, target: SurfacePoints) -> Correspondence:
    """The nearest point of ``target`` for each of ``source``."""
    distance_N, index_N = cKDTree(target.points_N3, balanced_tree=False).query(source.points_N3)
    cosine_N = np.abs(np.einsum("nd,nd->n", source.normals_N3, target.normals_N3[index_N]))
    return Correspondence(distance_N, cosine_N)


def chamfer_l1(to_true: Correspondence, to_predicted: Correspondence) -> float:
    """Half the sum of the mean Euclidean distances both ways."""
    return float(to_true.distance_N.mean() + to_predicted.distance_N.mean()) / 2


def normal_consistency(to_true: Correspondence, to_predicted: Correspondence) -> float:
    """Half the sum of the mean absolute cosines both ways."""
    return float(to_true.cosine_N.mean() + to_predicted.cosine_N.mean()) / 2


def f_score(to_true: Correspondence, to_predicted: Correspondence, distance: float) -> float:
    """Harmonic mean of precision and recall at a distance; 0 where both are 0."""
    precision = float((to_true.distance_N <= distance).mean())
    recall = float((to_predicted.distance_N <= distance).mean())
    return 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0
