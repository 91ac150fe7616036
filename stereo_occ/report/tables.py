"""The numbers of the page: means with bootstrap intervals, by the statistics of ``compare``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stereo_occ.compare import Results, compare
from stereo_occ.evaluation_rows import Evaluations
from stereo_occ.metrics.statistics import Difference
from stereo_occ.metrics.summary import METRICS
from stereo_occ.report.models import Model, in_order

#: Table 1 of Chun and Zhang, Stereo Occupancy Networks: volumetric IoU on ShapeNet.
PUBLISHED = {"Monocular": 0.1896, "Stereo": 0.1153}

#: What Table 1 shows besides ``iou`` per category.
IOUS = ("iou", "iou_bbox", "iou_unrotated")

#: What says the same as another metric.
REPEATED = ("chamfer_l1_x10",)


@dataclass(frozen=True)
class Cell:
    """A mean, or a difference of two, with its interval, None where there is none.

    Attributes:
        clear: whether it is a difference whose interval leaves out 0.
    """

    value: float
    low: float | None
    high: float | None
    is_difference: bool = False
    clear: bool = False

    @property
    def text(self) -> str:
        """With three decimals, a difference with its sign."""
        return f"{self.value:{self._format}}"

    @property
    def interval(self) -> str:
        """``[low, high]``; empty if there is none."""
        if self.low is None or self.high is None:
            return ""
        return f"[{self.low:{self._format}}, {self.high:{self._format}}]"

    @property
    def _format(self) -> str:
        return "+.3f" if self.is_difference else ".3f"


@dataclass(frozen=True)
class Row:
    """A line of a table: the cells by column, those that do not apply left out."""

    model: Model | None
    label: str
    cells: Mapping[str, Cell]


@dataclass(frozen=True)
class Tables:
    """What the page tells in numbers.

    Attributes:
        columns: of ``table_1``: ``iou``, ``iou/<category>``, then the other ways to measure it.
        table_1: a row for each model, then the difference, if there are two models.
        every_metric: a row for each metric, a cell for each model's label and for ``difference``.
        difference: of the model in focus and what it is set against.
    """

    columns: list[str]
    table_1: list[Row]
    every_metric: list[Row]
    difference: Results | None


def make_tables(models: Sequence[Model], focus: Model, against: Model | None, draws: int) -> Tables:
    """Means of each model and the difference of the two, each with its 95 % interval.

    Objects are drawn within their category, seeds of each model beside them; see
    :func:`~stereo_occ.metrics.statistics.paired_bootstrap`. The interval of a mean is that of its difference from 0.
    """
    means = [compare(m.evaluations, _nothing(m.evaluations), None, draws) for m in models]
    difference = compare(focus.evaluations, against.evaluations, None, draws) if against else None
    categories = in_order(place for place in means[0][IOUS[0]] if place != "macro")
    columns = [IOUS[0], *(f"{IOUS[0]}/{category}" for category in categories), *IOUS[1:]]
    table_1 = [
        Row(model, model.label, _cells(results, columns, False))
        for model, results in zip(models, means, strict=True)
    ]
    if difference and against:
        table_1.append(Row(None, f"{focus.label} - {against.label}", _cells(difference, columns, True)))
    every_metric = []
    for metric in METRICS:
        cells = {
            model.label: _cell(results[metric]["macro"], False)
            for model, results in zip(models, means, strict=True)
            if metric in results
        }
        if difference and metric in difference:
            cells["difference"] = _cell(difference[metric]["macro"], True)
        if cells and metric not in REPEATED:
            every_metric.append(Row(None, metric, cells))
    return Tables(columns, table_1, every_metric, difference)


def headline(row: Row) -> str:
    """A mean of Table 1 with its interval, as text."""
    cell = row.cells[IOUS[0]]
    return f"{cell.text} {cell.interval}".strip()


def _nothing(evaluations: Evaluations) -> Evaluations:
    """One seed that scores 0 wherever these have a value."""
    zero = {
        name: np.where(np.isfinite(values[:1]), 0.0, np.nan) for name, values in evaluations.values.items()
    }
    return replace(evaluations, values=zero)


def _cells(results: Results, columns: Sequence[str], is_difference: bool) -> dict[str, Cell]:
    cells: dict[str, Cell] = {}
    for column in columns:
        metric, _, category = column.partition("/")
        place = category or "macro"
        if metric in results and place in results[metric]:
            cells[column] = _cell(results[metric][place], is_difference)
    return cells


def _cell(row: Difference, is_difference: bool) -> Cell:
    return Cell(row.difference, row.low, row.high, is_difference, is_difference and row.clear)
