"""The plots of the page."""

import io
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from stereo_occ.metrics.calibration import BINS
from stereo_occ.metrics.curves import LEVELS, average_precision, precision_recall_curve
from stereo_occ.report.models import Model, in_order

#: Colours that the colour-blind tell apart (Okabe and Ito), for models in the order of the page.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f", "#000000")

STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9aa1ab",
    "axes.labelcolor": "#3b424c",
    "axes.titlesize": 9.5,
    "xtick.color": "#6b727c",
    "ytick.color": "#6b727c",
    "grid.color": "#e4e7eb",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.fonttype": "none",
    "text.parse_math": False,  # labels hold settings such as ${steps}
}

#: Behind text that may lie on a line.
_VEIL = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1}

Colored = Sequence[tuple[Model, str]]


@mpl.rc_context(STYLE)
def learning_curves(models: Colored) -> Figure | None:
    """IoU and loss on validation objects along each training, seeds thin and their mean thick."""
    histories = [(model, color, _histories(model)) for model, color in models]
    histories = [entry for entry in histories if entry[2]]
    if not histories:
        return None
    keys = {"val/iou": "iou", "val/iou_bbox": "iou_bbox", "val/loss": "loss"}
    figure, axes = _panels(len(keys))
    for axis, (key, name) in zip(axes, keys.items(), strict=True):
        for model, color, seeds in histories:
            lines = [
                {entry["step"]: entry[key] for entry in seed if entry.get(key) is not None} for seed in seeds
            ]
            lines = [line for line in lines if line]
            if len(lines) > 1:
                for line in lines:
                    axis.plot(list(line), list(line.values()), color=color, linewidth=0.7, alpha=0.5)
            steps = sorted(set.intersection(*map(set, lines))) if lines else []
            mean = [float(np.mean([line[step] for line in lines])) for step in steps]
            axis.plot(steps, mean, ".-", color=color, linewidth=1.8, markersize=5, label=model.label)
        axis.set(title=f"{name} on validation objects", xlabel="step")
        axis.grid()
        if name != "loss":
            axis.set_ylim(bottom=0)
    _legend(figure, axes[0])
    return figure


@mpl.rc_context(STYLE)
def precision_recall(counts: Mapping[str, Mapping[str, NDArray[np.int64]]], models: Colored) -> Figure | None:
    """Precision over recall of all points of a category, a dot at the decision threshold.

    Args:
        counts: of :func:`~stereo_occ.metrics.curves.logit_counts`, by label and category.
    """
    having = [(model, color) for model, color in models if model.label in counts]
    if not having:
        return None
    categories = in_order(category for of_model in counts.values() for category in of_model)
    figure, axes = _panels(len(categories))
    for axis, category in zip(axes, categories, strict=True):
        notes = []
        for model, color in having:
            counts_2K = counts[model.label][category]
            precision_K, recall_K = precision_recall_curve(counts_2K)
            known_K = np.isfinite(precision_K)
            axis.plot(recall_K[known_K], precision_K[known_K], color=color, linewidth=1.8, label=model.label)
            threshold = np.clip(
                np.mean([facts["threshold"] for facts in model.evaluations.facts]), 1e-6, 1 - 1e-6
            )
            at = int(np.searchsorted(LEVELS, np.log(threshold / (1 - threshold)), side="right"))
            axis.plot(recall_K[at], precision_K[at], "o", color=color, markersize=6)
            notes.append((f"AP {average_precision(counts_2K):.2f}", color))
        for row, (note, color) in enumerate(reversed(notes)):
            axis.text(
                0.03,
                0.04 + 0.085 * row,
                note,
                color=color,
                transform=axis.transAxes,
                fontsize=8.5,
                bbox=_VEIL,
            )
        axis.set(title=category, xlabel="recall", xlim=(0, 1.02), ylim=(0, 1.02))
        axis.grid()
    axes[0].set_ylabel("precision")
    _legend(figure, axes[0])
    return figure


@mpl.rc_context(STYLE)
def reliability(models: Colored) -> Figure:
    """Share of occupied points over what the networks gave as their probability, in 15 bins."""
    categories = in_order(models[0][0].facts["reliability"])
    figure, axes = _panels(len(categories))
    for axis, category in zip(axes, categories, strict=True):
        axis.plot([0, 1], [0, 1], color="#9aa1ab", linewidth=0.8, linestyle="--")
        for model, color in models:
            points_K, mean_K, occupied_K = _pooled(
                [facts["reliability"][category] for facts in model.evaluations.facts]
            )
            axis.plot(mean_K, occupied_K, color=color, linewidth=1.4, label=model.label)
            size_K = 6 + 60 * points_K / points_K.sum()
            axis.scatter(mean_K, occupied_K, s=size_K, color=color, zorder=3)
        axis.set(title=category, xlabel="predicted probability", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        axis.grid()
    axes[0].set_ylabel("share of points occupied")
    _legend(figure, axes[0])
    return figure


@mpl.rc_context(STYLE)
def scatter(focus: Model, against: Model, metric: str = "iou") -> Figure:
    """One dot per object: its mean over views and seeds by one model and by the other."""
    categories = in_order(focus.evaluations.categories)
    figure, axes = _panels(len(categories))
    of_both = [_by_object(model, metric) for model in (against, focus)]
    for axis, category, color in zip(axes, categories, COLORS[2:], strict=False):
        objects = sorted(name for name in of_both[1] if name[0] == category)
        x_O, y_O = (np.array([np.mean(of[name]) for name in objects]) for of in of_both)
        top = 1.05 * max(x_O.max(), y_O.max(), 0.05)
        axis.plot([0, top], [0, top], color="#9aa1ab", linewidth=0.8, linestyle="--")
        axis.scatter(x_O, y_O, s=20, color=color, alpha=0.75, edgecolors="white", linewidths=0.5)
        wins = int((y_O > x_O).sum())
        axis.set(
            title=f"{category}: above in {wins} of {len(objects)}",
            xlim=(0, top),
            ylim=(0, top),
            aspect="equal",
        )
        axis.set_xlabel(fill(f"{metric} of {against.label}", 32))
        axis.grid()
    axes[0].set_ylabel(fill(f"{metric} of {focus.label}", 32))
    return figure


def _by_object(model: Model, metric: str) -> dict[tuple[str, str], list[float]]:
    """Means over seeds of each object's views."""
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    values_V = model.evaluations.values[metric].mean(axis=0)
    for (category, object_id, _), value in zip(model.evaluations.keys, values_V.tolist(), strict=True):
        found[category, object_id].append(value)
    return found


def svg(figure: Figure, name: str) -> str:
    """The figure as an ``<svg>`` element that scales with its place; the same for the same figure.

    Args:
        name: makes the ids in it differ from those of other figures in one page.
    """
    file = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    text = file.getvalue()
    text = re.sub(r'\bid="', f'id="{name}-', text[text.index("<svg") :])
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    head, rest = text.split(">", 1)
    return re.sub(r' (width|height)="[^"]*"', "", head) + ">" + rest


def png(figure: Figure) -> bytes:
    """The figure as PNG."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=150)
    return file.getvalue()


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(max(3.1 * count, 4.5), 3.3), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(1, count, squeeze=False).ravel())


def _legend(figure: Figure, axis: Axes) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)), frameon=False)


def _histories(model: Model) -> list[list[dict[str, float]]]:
    known = [(facts.get("trained") or {}).get("history", []) for facts in model.evaluations.facts]
    return [history for history in known if history]


def _pooled(seeds: Sequence[Sequence[Sequence[float]]]) -> NDArray[np.float64]:
    """Points, mean probability and share occupied ``(3, K)`` of the bins that have points in any seed."""
    sums_3K = np.zeros((3, BINS))
    for n, probability, occupied in (row for seed in seeds for row in seed):
        sums_3K[:, min(int(probability * BINS), BINS - 1)] += n, n * probability, n * occupied
    points_K, probability_K, occupied_K = sums_3K[:, sums_3K[0] > 0]
    return np.stack([points_K, probability_K / points_K, occupied_K / points_K])
