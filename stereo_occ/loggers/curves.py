"""Precision against recall and the reliability of probabilities, as one small picture."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch import Tensor

from stereo_occ.metrics.calibration import reliability
from stereo_occ.metrics.curves import logit_counts, precision_recall_curve


def curves_picture(logits_N: Tensor, occupied_N: Tensor, threshold: float) -> NDArray[np.uint8]:
    """RGB ``(H, W, 3)``: precision over recall with the decision threshold marked, and reliability."""
    figure = Figure(figsize=(6.4, 3), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    precision_K, recall_K = precision_recall_curve(logit_counts(logits_N, occupied_N.bool()))
    left.plot(recall_K, precision_K)
    probability_N, truth_N = logits_N.sigmoid().numpy(), occupied_N.bool().numpy()
    predicted_N = probability_N >= threshold
    if (hits := int((predicted_N & truth_N).sum())) > 0:
        place = hits / truth_N.sum(), hits / predicted_N.sum()
        left.plot(*place, "o", label=f"threshold {threshold:.2f}")
        left.legend(loc="lower left", fontsize=7)
    left.set(xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02))
    points_K, probability_K, occupied_K = reliability(probability_N, truth_N)
    used_K = points_K > 0
    right.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    right.plot(probability_K[used_K] / points_K[used_K], occupied_K[used_K] / points_K[used_K], "o-")
    right.set(xlabel="predicted probability", ylabel="share occupied", xlim=(0, 1), ylim=(0, 1))
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]
