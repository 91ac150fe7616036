"""From rows of object-views to the numbers of a table, as the protocol says."""

from collections.abc import Mapping, Sequence
from typing import Any

import torch

from stereo_occ.metrics.volumetric import category_means

#: Every metric of an object-view and whether more of it is better. Where one does not apply, a row holds None.
METRICS = {
    "iou": True,
    "iou_bbox": True,
    "iou_unrotated": True,
    "iou_at_0.5": True,
    "handle_recall": True,
    "neck_recall": True,
    "cavity_empty": True,
    "brier": False,
    "brier_bbox": False,
    "ece": False,
    "ece_bbox": False,
    "loss": False,
    "mesh_iou": True,
    "chamfer_l1": False,
    "chamfer_l1_x10": False,
    "normal_consistency": True,
    "f_score_1": True,
    "f_score_2": True,
    "recall_2_visible": True,
    "recall_2_occluded": True,
    "height_error": False,
    "width_error": False,
}

#: What identifies a row.
ROW_KEYS = ("category", "object_id", "view")


def summarise(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """``iou`` (mean of category means), ``iou/all``, ``iou/<category>``, and likewise for every metric that rows have.

    A category without any value of a metric (bowls have no handle) takes no part in its macro mean.
    """
    values: dict[str, float] = {}
    for metric in METRICS:
        having = [row for row in rows if row.get(metric) is not None]
        if having:
            column_V = torch.tensor([row[metric] for row in having], dtype=torch.float64)
            means = category_means(column_V, [row["category"] for row in having])
            values[metric] = means.pop("macro")
            values |= {f"{metric}/{name}": mean for name, mean in means.items()}
    return values
