"""Precision and recall at every decision threshold, from the numbers of points between levels of the logit.

Numbers of several object-views add up, so a curve is that of all their points together.
"""

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

#: Levels of the logit: probabilities from 0.0003 to 0.9997, denser towards both ends.
LEVELS = np.linspace(-8, 8, 129)


def logit_counts(logits_N: Tensor, occupied_N: Tensor) -> NDArray[np.int64]:
    """``(2, K)``: how many empty and how many occupied points lie below the first level, between two, above the last.

    A logit that equals a level lies above it. A view with a NaN has failed: it counts as the surest wrong answers.

    Args:
        logits_N, occupied_N: occupancy logits and boolean labels.
    """
    logits, occupied = logits_N.double().numpy(), occupied_N.numpy()
    if np.isnan(logits).any():
        logits = np.where(occupied, -np.inf, np.inf)
    bin_N = np.searchsorted(LEVELS, logits, side="right")
    sides = (bin_N[~occupied], bin_N[occupied])
    return np.stack([np.bincount(side, minlength=len(LEVELS) + 1) for side in sides])


def precision_recall_curve(counts_2K: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Precision and recall, each ``(K,)``, of the thresholds -inf and :data:`LEVELS`, from :func:`logit_counts`.

    Precision is NaN where nothing is predicted, recall where nothing is occupied.
    """
    false_K, true_K = counts_2K[:, ::-1].cumsum(axis=1)[:, ::-1].astype(np.float64)
    with np.errstate(invalid="ignore"):
        return true_K / (true_K + false_K), true_K / true_K[0]


def average_precision(counts_2K: NDArray[np.int64]) -> float:
    """Mean precision over the occupied points, each at the level below it; NaN if there are none."""
    precision_K, _ = precision_recall_curve(counts_2K)
    occupied_K = counts_2K[1]
    has_K = occupied_K > 0
    if not has_K.any():
        return float("nan")
    return float(np.average(precision_K[has_K], weights=occupied_K[has_K]))
