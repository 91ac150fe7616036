"""The mesh metrics of the protocol for one object-view.

An empty mesh scores 0, and the cube's diagonal for Chamfer-L1; one that bounds no solid scores 0 for ``mesh_iou``
alone. Both are named as failures, so that they are counted and never left out of a mean.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.metrics.solid import mesh_iou
from stereo_occ.metrics.surface import (
    CUBE_DIAGONAL,
    F_DISTANCES,
    chamfer_l1,
    correspond,
    f_score,
    normal_consistency,
    surface_points,
)
from stereo_occ.metrics.visibility import visible

#: Distance at which a part of the true surface counts as found.
FOUND = F_DISTANCES["f_score_2"]


@dataclass(frozen=True)
class MeshScores:
    """Metrics by name; a None has nothing to measure (a surface without occluded points).

    Attributes:
        failure: ``empty mesh`` or ``no solid``; empty where there is none.
    """

    values: dict[str, float | None]
    failure: str = ""


def compare_meshes(
    predicted: Trimesh,
    true: Trimesh,
    centers_C3: NDArray[np.float64],
    count: int,
    rng: np.random.Generator,
) -> MeshScores:
    """All mesh metrics of a prediction; both meshes and the optical centres ``(C, 3)`` in the rig frame.

    Args:
        count: points on each surface.
    """
    true_points = surface_points(true, count, rng)
    seen_N = visible(true, true_points.points_N3, centers_C3)
    if not len(predicted.faces) or not predicted.area > 0:
        zero = dict.fromkeys(("mesh_iou", "normal_consistency", *F_DISTANCES), 0.0)
        chamfer = {"chamfer_l1": CUBE_DIAGONAL, "chamfer_l1_x10": 10 * CUBE_DIAGONAL}
        return MeshScores({**zero, **chamfer, **_recalls(np.zeros(count, bool), seen_N)}, "empty mesh")
    points = surface_points(predicted, count, rng)
    to_true, to_predicted = correspond(points, true_points), correspond(true_points, points)
    chamfer_1 = chamfer_l1(to_true, to_predicted)
    volume_ratio = mesh_iou(predicted, true)
    values = {
        "mesh_iou": 0.0 if volume_ratio is None else volume_ratio,
        "chamfer_l1": chamfer_1,
        "chamfer_l1_x10": 10 * chamfer_1,
        "normal_consistency": normal_consistency(to_true, to_predicted),
        **{name: f_score(to_true, to_predicted, distance) for name, distance in F_DISTANCES.items()},
        **_recalls(to_predicted.distance_N <= FOUND, seen_N),
    }
    return MeshScores(values, "no solid" if volume_ratio is None else "")


def _recalls(found_N: NDArray[np.bool_], seen_N: NDArray[np.bool_]) -> dict[str, float | None]:
    """Shares of the visible and of the occluded true surface that were found."""
    parts = {"recall_2_visible": seen_N, "recall_2_occluded": ~seen_N}
    return {name: float(found_N[part_N].mean()) if part_N.any() else None for name, part_N in parts.items()}
