"""IoU of many object-views, gathered batch by batch and summed up as the protocol says."""

from collections.abc import Iterable, Mapping
from dataclasses import astuple

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from stereo_occ.data.batch import Batch, ViewId
from stereo_occ.decision import Decision, DecisionRule, level_shift
from stereo_occ.metrics.volumetric import best_threshold, category_means, iou_at_thresholds

#: The metric that each set of evaluation points gives.
IOU_OF = {"cube": "iou", "bbox": "iou_bbox", "unposed": "iou_unrotated"}

#: Candidate decision thresholds on the occupancy probability.
THRESHOLDS = torch.linspace(0.05, 0.95, 37)

HALF_1 = torch.tensor([0.5])


class Scores:
    """Loss on the points of the box, and IoU at every candidate threshold (increasing probabilities), of each view.

    What is summed up does not depend on the order in which views came, nor on how often one did.

    Args:
        rule: what the candidates refer to.
    """

    def __init__(self, thresholds_T: Tensor = THRESHOLDS, rule: DecisionRule = DecisionRule.fixed) -> None:
        self.thresholds_T = thresholds_T
        self.rule = rule
        self._loss: dict[ViewId, Tensor] = {}
        self._shift: dict[ViewId, Tensor] = {}
        self._iou: dict[str, dict[ViewId, Tensor]] = {name: {} for name in IOU_OF.values()}
        self._iou_at_half: dict[ViewId, Tensor] = {}

    def update(self, batch: Batch, logits: Mapping[str, Tensor]) -> None:
        """Add a batch; ``logits`` holds ``(B, N)`` for each of the batch's query sets."""
        occupied_BN = batch.queries["bbox"].occupied_BN
        loss_BN = binary_cross_entropy_with_logits(logits["bbox"], occupied_BN, reduction="none")
        self._loss |= zip(batch.ids, loss_BN.mean(dim=1).cpu(), strict=True)
        shift_B = level_shift(self.rule, logits["cube"])
        self._shift |= zip(batch.ids, shift_B.cpu(), strict=True)
        inside = {name: queries.occupied_BN > 0.5 for name, queries in batch.queries.items()}
        for queries, metric in IOU_OF.items():
            iou_BT = iou_at_thresholds(logits[queries] - shift_B[:, None], inside[queries], self.thresholds_T)
            self._iou[metric] |= zip(batch.ids, iou_BT.cpu(), strict=True)
        iou_B1 = iou_at_thresholds(logits["cube"], inside["cube"], HALF_1)
        self._iou_at_half |= zip(batch.ids, iou_B1[:, 0].cpu(), strict=True)

    def merge(self, others: Iterable["Scores"]) -> None:
        """Add the views of others."""
        for other in others:
            self._loss |= other._loss
            self._shift |= other._shift
            self._iou_at_half |= other._iou_at_half
            for metric, iou in other._iou.items():
                self._iou[metric] |= iou

    def loss(self) -> float:
        """The mean over all views."""
        return float(torch.stack([self._loss[view] for view in self._ids]).double().mean())

    def iou_at_half(self) -> float:
        """Macro ``iou`` where a probability of 0.5 decides, whatever the rule."""
        iou_V = torch.stack([self._iou_at_half[view] for view in self._ids])
        return category_means(iou_V, self._categories)["macro"]

    def mean_threshold(self, decision: Decision) -> float:
        """Of the thresholds on the probability that a decision comes to, over all views."""
        return float(decision.shifted(torch.stack([self._shift[view] for view in self._ids])).mean())

    def best_threshold(self) -> float:
        """The candidate with the highest macro ``iou``: to be called on validation data only."""
        iou_VT = torch.stack([self._iou["iou"][view] for view in self._ids])
        return best_threshold(iou_VT, self._categories, self.thresholds_T)

    def summary(self, threshold: float) -> dict[str, float]:
        """``iou`` (macro), ``iou/all``, ``iou/<category>`` and likewise for the other metrics, at ``threshold``."""
        column = int((self.thresholds_T - threshold).abs().argmin())
        values: dict[str, float] = {}
        for metric, iou in self._iou.items():
            iou_V = torch.stack([iou[view][column] for view in self._ids])
            means = category_means(iou_V, self._categories)
            values[metric] = means.pop("macro")
            values |= {f"{metric}/{name}": mean for name, mean in means.items()}
        return values

    @property
    def _ids(self) -> list[ViewId]:
        return sorted(self._loss, key=astuple)

    @property
    def _categories(self) -> list[str]:
        return [view.category for view in self._ids]
