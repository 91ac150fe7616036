"""What a search has found: a table of its trials, a picture of them, and the best one."""

import csv
from collections.abc import Mapping, Sequence
from io import StringIO
from math import ceil
from pathlib import Path
from typing import Any

import yaml
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial, TrialState

from stereo_occ.search.study import overrides_of
from stereo_occ.writing import whole_file

_COLUMNS = 3


def write_results(
    folder: Path,
    trials: Sequence[FrozenTrial],
    best: FrozenTrial | None,
    space: Mapping[str, BaseDistribution],
    objective: str,
) -> None:
    """Write ``trials.csv``, ``trials.png`` and ``best.yaml`` into ``folder``.

    Args:
        objective: what the values are.
    """
    names = sorted(space)
    text = StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["trial", "state", objective, "seconds", *names])
    for trial in trials:
        seconds = "" if trial.duration is None else f"{trial.duration.total_seconds():.0f}"
        value = "" if trial.value is None else f"{trial.value:.4f}"
        settings = [trial.params.get(name, "") for name in names]
        table.writerow([trial.number, trial.state.name.lower(), value, seconds, *settings])
    with whole_file(folder / "trials.csv") as file:
        file.write(text.getvalue().encode())
    if best is not None:
        found = {"trial": best.number, objective: best.value, "overrides": overrides_of(best)}
        with whole_file(folder / "best.yaml") as file:
            file.write(yaml.safe_dump(found, sort_keys=False).encode())
        _draw(folder / "trials.png", trials, best, {name: space[name] for name in names}, objective)


def _draw(
    path: Path,
    trials: Sequence[FrozenTrial],
    best: FrozenTrial,
    space: Mapping[str, BaseDistribution],
    objective: str,
) -> None:
    complete = [trial for trial in trials if trial.state is TrialState.COMPLETE]
    values = [trial.value or 0.0 for trial in complete]
    rows = ceil((1 + len(space)) / _COLUMNS)
    figure = Figure(figsize=(3.2 * _COLUMNS, 2.6 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, _COLUMNS, squeeze=False, sharey=True).ravel()
    axes[0].step(
        [trial.number for trial in complete],
        [max(values[: i + 1]) for i in range(len(values))],
        color="0.6",
        where="post",
        label="best so far",
    )
    _dots(axes[0], [trial.number for trial in complete], values, complete.index(best))
    axes[0].set_xlabel("trial")
    axes[0].legend(fontsize=7)
    for axis, (name, distribution) in zip(axes[1:], space.items(), strict=False):
        _dots(axis, [trial.params[name] for trial in complete], values, complete.index(best))
        axis.set_xlabel(name)
        if isinstance(distribution, CategoricalDistribution):
            axis.tick_params(axis="x", labelsize=7)
        elif isinstance(distribution, (FloatDistribution, IntDistribution)) and distribution.log:
            axis.set_xscale("log")
    for axis in axes[1 + len(space) :]:
        axis.set_axis_off()
    for axis in axes[::_COLUMNS]:
        axis.set_ylabel(objective)
    with whole_file(path) as file:
        figure.savefig(file, format="png", dpi=110)


def _dots(axis: Axes, places: Sequence[Any], values: Sequence[float], best: int) -> None:
    axis.plot(places, values, "o", color="C0")
    axis.plot(places[best : best + 1], values[best : best + 1], "o", color="C3")
    axis.grid(alpha=0.3)
