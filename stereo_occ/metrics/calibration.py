"""Calibration of the occupancy probability: Brier score and expected calibration error.

The expected calibration error (Naeini et al. 2015, Guo et al. 2017) takes :data:`BINS` bins of equal width: the mean,
over all points, of the gap between the mean probability and the share of occupied points in a point's bin.
"""

import numpy as np
from numpy.typing import NDArray

BINS = 15


def brier(probability_N: NDArray[np.floating], occupied_N: NDArray[np.bool_]) -> float:
    """Mean squared gap between probability and truth: 0 is perfect, 0.25 is a constant 1/2."""
    return float(np.square(probability_N.astype(np.float64) - occupied_N).mean())


def reliability(probability_N: NDArray[np.floating], occupied_N: NDArray[np.bool_]) -> NDArray[np.float64]:
    """``(3, BINS)``: points, sum of their probabilities and number of occupied ones; of several sets they add up."""
    probability_N = probability_N.astype(np.float64)
    bin_N = np.clip((probability_N * BINS).astype(np.intp), 0, BINS - 1)
    weights = (None, probability_N, occupied_N.astype(np.float64))
    return np.stack([np.bincount(bin_N, weights=w, minlength=BINS).astype(np.float64) for w in weights])


def expected_calibration_error(reliability_3K: NDArray[np.float64]) -> float:
    """From the sums of :func:`reliability`."""
    points_K, probability_K, occupied_K = reliability_3K
    return float(np.abs(probability_K - occupied_K).sum() / points_K.sum())
