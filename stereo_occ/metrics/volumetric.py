"""Volumetric IoU on labelled points, at one or at many decision thresholds.

Rules that hold throughout: a ratio whose denominator is 0 is 1 if prediction and truth are both empty, else
0; an object-view with a NaN among its logits has failed and scores 0. Nothing is ever left out of a mean.
"""

from collections.abc import Sequence

import torch
from torch import Tensor


def iou_at_thresholds(logits_BN: Tensor, occupied_BN: Tensor, thresholds_T: Tensor) -> Tensor:
    """IoU ``(B, T)`` where a point is predicted occupied if its probability is at least the threshold.

    Args:
        logits_BN: occupancy logits.
        occupied_BN: boolean labels.
        thresholds_T: probabilities, increasing, between 0 and 1.

    Raises:
        ValueError: if the thresholds are not increasing between 0 and 1.
    """
    true_BT, false_BT, positives_B1 = _count(logits_BN, occupied_BN, thresholds_T)
    union_BT = positives_B1 + false_BT
    iou_BT = torch.where(union_BT == 0, 1.0, true_BT / union_BT.clamp(min=1))  # two empty sets are alike
    return _failed_is_zero(iou_BT, logits_BN)


def category_means(values_V: Tensor, categories: Sequence[str]) -> dict[str, float]:
    """Mean per category, ``macro``: the mean of those means, and ``all``: the mean over all values ``(V,)``.

    Raises:
        ValueError: if there are no values, or not one category for each.
    """
    if len(values_V) != len(categories) or not categories:
        raise ValueError(
            f"{len(values_V)} values for {len(categories)} categories: need one each, at least one"
        )
    values_V = values_V.double()
    means = {
        name: float(values_V[torch.tensor([category == name for category in categories])].mean())
        for name in sorted(set(categories))
    }
    return means | {"macro": sum(means.values()) / len(means), "all": float(values_V.mean())}


def best_threshold(iou_VT: Tensor, categories: Sequence[str], thresholds_T: Tensor) -> float:
    """The threshold with the highest mean of category means; among equals, the one closest to 0.5."""
    candidates = [
        (category_means(iou_V, categories)["macro"], -abs(threshold - 0.5), threshold)
        for iou_V, threshold in zip(iou_VT.T, thresholds_T.tolist(), strict=True)
    ]
    return float(max(candidates)[-1])


def _count(logits_BN: Tensor, occupied_BN: Tensor, thresholds_T: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """True and false positives ``(B, T)`` at each threshold, and the occupied points ``(B, 1)``.

    One pass, whatever T: each logit falls into one of T + 1 bins, and the bins above a threshold are summed.
    """
    levels_T = torch.logit(thresholds_T.double())
    if not (levels_T.isfinite().all() and (levels_T.diff() > 0).all()):
        raise ValueError(f"thresholds must increase between 0 and 1, got {thresholds_T.tolist()}")
    batch, bins = len(logits_BN), len(levels_T) + 1
    bin_BN = torch.bucketize(logits_BN.double(), levels_T.to(logits_BN.device), right=True)
    row_B1 = torch.arange(batch, device=logits_BN.device)[:, None]
    flat_BN = (row_B1 * 2 + occupied_BN.long()) * bins + bin_BN
    count_B2K = flat_BN.flatten().bincount(minlength=batch * 2 * bins).view(batch, 2, bins)
    above_B2K = count_B2K.flip(-1).cumsum(-1).flip(-1)
    return above_B2K[:, 1, 1:], above_B2K[:, 0, 1:], above_B2K[:, 1, :1]


def _failed_is_zero(score_BT: Tensor, logits_BN: Tensor) -> Tensor:
    """The scores, 0 for object-views with a NaN logit."""
    return score_BT.masked_fill(logits_BN.isnan().any(dim=1, keepdim=True), 0)
