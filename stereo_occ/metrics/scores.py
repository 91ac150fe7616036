"""IoU of many object-views, gathered batch by batch and summed up as the protocol says."""

from collections.abc import Mapping

import torch
from torch import Tensor

from stereo_occ.data.batch import Batch, ViewId
from stereo_occ.metrics.volumetric import best_threshold, category_means, iou_at_thresholds

#: The metric that each set of evaluation points gives.
METRICS = {"cube": "iou", "bbox": "iou_bbox", "unposed": "iou_unrotated"}

#: Candidate decision thresholds on the occupancy probability.
THRESHOLDS = torch.linspace(0.05, 0.95, 19)


class Scores:
    """IoU at every candidate threshold (increasing probabilities), for each view and metric."""

    def __init__(self, thresholds_T: Tensor = THRESHOLDS) -> None:
        self.thresholds_T = thresholds_T
        self.ids: list[ViewId] = []
        self._iou: dict[str, list[Tensor]] = {name: [] for name in METRICS.values()}

    def update(self, batch: Batch, logits: Mapping[str, Tensor]) -> None:
        """Add a batch; ``logits`` holds ``(B, N)`` for each of the batch's query sets."""
        self.ids += batch.ids
        for queries, metric in METRICS.items():
            iou_BT = iou_at_thresholds(
                logits[queries], batch.queries[queries].occupied_BN > 0.5, self.thresholds_T
            )
            self._iou[metric].append(iou_BT.cpu())

    def best_threshold(self) -> float:
        """The candidate with the highest macro ``iou``: to be called on validation data only."""
        return best_threshold(torch.cat(self._iou["iou"]), self._categories, self.thresholds_T)

    def summary(self, threshold: float) -> dict[str, float]:
        """``iou`` (macro), ``iou/all``, ``iou/<category>`` and likewise for the other metrics, at ``threshold``."""
        values: dict[str, float] = {}
        for metric, iou_V in self._at(threshold).items():
            means = category_means(iou_V, self._categories)
            values[metric] = means.pop("macro")
            values |= {f"{metric}/{name}": mean for name, mean in means.items()}
        return values

    @property
    def _categories(self) -> list[str]:
        return [view.category for view in self.ids]

    def _at(self, threshold: float) -> dict[str, Tensor]:
        column = int((self.thresholds_T - threshold).abs().argmin())
        return {metric: torch.cat(parts)[:, column] for metric, parts in self._iou.items() if parts}
