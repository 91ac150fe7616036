"""A forest plot: differences with their intervals, one panel per metric."""

from collections.abc import Mapping
from math import ceil
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from stereo_occ.metrics.statistics import Difference
from stereo_occ.metrics.summary import METRICS
from stereo_occ.printable import printable
from stereo_occ.writing import whole_file

_COLUMNS = 4


def forest_plot(
    results: Mapping[str, Mapping[str, Difference]], name_a: str, name_b: str, path: Path
) -> None:
    """Write the figure as PNG."""
    with whole_file(path) as file:
        forest_figure(results, name_a, name_b).savefig(file, dpi=110, format="png")


def forest_figure(results: Mapping[str, Mapping[str, Difference]], name_a: str, name_b: str) -> Figure:
    """A - B of every metric; green favours A, red favours B, grey leaves it open."""
    rows = max(1, ceil(len(results) / _COLUMNS))
    figure = Figure(figsize=(3.2 * _COLUMNS, 0.6 + 1.7 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axis, (metric, differences) in zip(axes, results.items(), strict=False):
        _panel(axis, metric, differences)
    for axis in axes[len(results) :]:
        axis.set_axis_off()
    title = f"A - B with 95 % intervals\nA: {printable(name_a)}   B: {printable(name_b)}"
    figure.suptitle(title, fontsize=9, parse_math=False)  # a folder's name may hold dollars
    return figure


def _panel(axis: Axes, metric: str, differences: Mapping[str, Difference]) -> None:
    places = list(differences)[::-1]
    for height, place in enumerate(places):
        row = differences[place]
        color = "0.5"
        if row.clear:
            color = "C2" if (row.difference > 0) == METRICS[metric] else "C3"
        if row.low is not None and row.high is not None:
            axis.plot([row.low, row.high], [height, height], color=color, linewidth=2)
        axis.plot(row.difference, height, "D" if place == "macro" else "o", color=color)
    axis.axvline(0, color="0.3", linewidth=0.8)
    axis.set_yticks(range(len(places)), places, fontsize=7)
    axis.set_ylim(-0.6, len(places) - 0.4)
    axis.tick_params(axis="x", labelsize=7)
    axis.locator_params(axis="x", nbins=4)
    axis.set_title(f"{metric} ({'more' if METRICS[metric] else 'less'} is better)", fontsize=8)
