"""Precision against recall and the reliability of probabilities, as one small picture."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from stereo_occ.metrics.calibration import reliability


def precision_recall(
    probability_N: NDArray[np.floating], occupied_N: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Precision and recall ``(N,)`` when the 1, 2, ... N most probable points are called occupied."""
    order_N = np.argsort(-probability_N, kind="stable")
    hits_N = np.cumsum(occupied_N[order_N], dtype=np.float64)
    return hits_N / np.arange(1, len(hits_N) + 1), hits_N / max(1.0, hits_N[-1])


def curves_picture(
    probability_N: NDArray[np.floating], occupied_N: NDArray[np.bool_], threshold: float
) -> NDArray[np.uint8]:
    """RGB ``(H, W, 3)``: precision over recall with the decision threshold marked, and reliability."""
    figure = Figure(figsize=(6.4, 3), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    precision_N, recall_N = precision_recall(probability_N, occupied_N)
    left.plot(recall_N, precision_N)
    chosen = int((probability_N >= threshold).sum())
    if chosen:
        left.plot(recall_N[chosen - 1], precision_N[chosen - 1], "o", label=f"threshold {threshold:.2f}")
        left.legend(loc="lower left", fontsize=7)
    left.set(xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02))
    points_K, probability_K, occupied_K = reliability(probability_N, occupied_N)
    used_K = points_K > 0
    right.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    right.plot(
        (probability_K / np.maximum(points_K, 1))[used_K],
        (occupied_K / np.maximum(points_K, 1))[used_K],
        "o-",
    )
    right.set(xlabel="predicted probability", ylabel="share occupied", xlim=(0, 1), ylim=(0, 1))
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]
