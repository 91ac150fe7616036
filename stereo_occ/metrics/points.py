"""The metrics of one object-view that labelled points give.

An object-view with a NaN among its logits has failed: it gets the worst value of each metric.
"""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from stereo_occ.metrics.calibration import brier, expected_calibration_error, reliability
from stereo_occ.metrics.regions import REGIONS
from stereo_occ.metrics.scores import IOU_OF
from stereo_occ.metrics.volumetric import iou_at_thresholds

#: Of a failed view: binary cross entropy where torch cuts it off.
WORST_LOSS = 100.0

#: The suffix of the calibration metrics on each set of points.
_CALIBRATED = {"cube": "", "bbox": "_bbox"}


def point_metrics(
    logits: Mapping[str, Tensor], occupied: Mapping[str, Tensor], threshold: float
) -> dict[str, float]:
    """IoU and calibration from logits ``(N,)`` and boolean labels ``(N,)`` of ``cube``, ``bbox`` and ``unposed``."""
    values = {
        metric: _iou(logits[queries], occupied[queries], threshold) for queries, metric in IOU_OF.items()
    }
    values["iou_at_0.5"] = _iou(logits["cube"], occupied["cube"], 0.5)
    bounded = logits["bbox"].clamp(-WORST_LOSS, WORST_LOSS)
    loss = binary_cross_entropy_with_logits(bounded, occupied["bbox"].float())
    values["loss"] = WORST_LOSS if loss.isnan() else float(loss)
    for queries, suffix in _CALIBRATED.items():
        failed = bool(logits[queries].isnan().any())
        probability_N, occupied_N = _probability(logits[queries]), occupied[queries].numpy()
        values[f"brier{suffix}"] = 1.0 if failed else brier(probability_N, occupied_N)
        sums_3K = reliability(probability_N, occupied_N)
        values[f"ece{suffix}"] = 1.0 if failed else expected_calibration_error(sums_3K)
    return values


def reliability_sums(logits_N: Tensor, occupied_N: Tensor) -> NDArray[np.float64]:
    """Sums of :func:`~stereo_occ.metrics.calibration.reliability`; of a failed view the surest wrong answers."""
    if logits_N.isnan().any():
        logits_N = torch.where(occupied_N, -torch.inf, torch.inf)
    return reliability(_probability(logits_N), occupied_N.numpy())


def region_metrics(logits: Mapping[str, Tensor], threshold: float) -> dict[str, float]:
    """Share of each region's points that are answered rightly, from logits ``(N,)`` by the region's metric."""
    level = torch.logit(torch.tensor(threshold, dtype=torch.float64))
    return {
        name: 0.0
        if logits_N.isnan().any()
        else float(((logits_N.double() >= level) == REGIONS[name]).double().mean())
        for name, logits_N in logits.items()
    }


def _iou(logits_N: Tensor, occupied_N: Tensor, threshold: float) -> float:
    return float(iou_at_thresholds(logits_N[None], occupied_N[None], torch.tensor([threshold]))[0, 0])


def _probability(logits_N: Tensor) -> NDArray[np.float64]:
    """In [0, 1]; 1/2 for NaN."""
    return np.asarray(logits_N.double().sigmoid().nan_to_num(0.5).numpy())
