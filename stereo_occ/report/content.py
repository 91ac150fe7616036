"""What the page and its Markdown version show, read from the folders of evaluations."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from tqdm import tqdm

from stereo_occ.comparison_plot import forest_figure
from stereo_occ.errors import UserError
from stereo_occ.evaluation_rows import find_evaluations
from stereo_occ.kept_views import read_kept_views
from stereo_occ.metrics.curves import LEVELS
from stereo_occ.report import figures
from stereo_occ.report.config import ReportConfig
from stereo_occ.report.gallery import GalleryRow, make_row
from stereo_occ.report.models import Model, read_models
from stereo_occ.report.selection import METRIC, best_median_worst, choose_models, failures
from stereo_occ.report.tables import REPEATED, Tables, make_tables

#: Text, as the pages write it, under each plot; ``{focus}`` and ``{against}`` are labels.
CAPTIONS = {
    "learning_curves": "Validation objects along each training: thin lines are seeds, thick ones their mean.",
    "precision_recall": "All points of the cube of a category together; the dot is the decision threshold, AP the mean "
    "precision over the occupied points.",
    "reliability": "How often points are occupied to which a probability was given, in 15 bins; larger dots hold more "
    "points. On the dashed line probabilities are true.",
    "scatter": "One dot per test object, the mean over its views and seeds; above the dashed line {focus} is better.",
    "differences": "{focus} minus {against} with 95 % intervals: green favours {focus}, red {against}, grey is open.",
}


@dataclass(frozen=True, eq=False)
class Content:
    """All that is shown.

    Attributes:
        models: with their colours; the model in focus first, then what it is set against.
        plots: by name, as in :data:`CAPTIONS`.
        examples, failures: rows of the galleries by category.
        drawings: of the rows' meshes, by row; None where OpenGL is not to be had.
        notes: what is missing and why, one line each.
    """

    title: str
    models: list[tuple[Model, str]]
    focus: Model
    against: Model | None
    tables: Tables
    plots: dict[str, Figure]
    examples: dict[str, list[GalleryRow]] = field(default_factory=dict)
    failures: dict[str, list[GalleryRow]] = field(default_factory=dict)
    drawings: dict[GalleryRow, list[Image.Image]] | None = None
    notes: list[str] = field(default_factory=list)

    def caption(self, name: str) -> str:
        """What is written under a plot."""
        return CAPTIONS[name].format(
            focus=self.focus.label, against=self.against.label if self.against else ""
        )


def read_content(settings: ReportConfig, patterns: Sequence[str]) -> Content:
    """Read the evaluations and compute what is to be shown.

    Raises:
        UserError: a folder holds no evaluation, or they are not of one test set; see :mod:`stereo_occ.report.models`.
    """
    models = read_models([folder for pattern in patterns for folder in find_evaluations(pattern)])
    focus, against = choose_models(models, settings.focus, settings.against)
    first = [focus, *([against] if against else [])]
    ordered = [*first, *(model for model in models if model not in first)]
    colored = [(model, figures.COLORS[index % len(figures.COLORS)]) for index, model in enumerate(ordered)]
    tables = make_tables(ordered, focus, against, settings.draws)
    notes: list[str] = []
    plots = _plots(colored, focus, against, tables, notes)
    examples, failed = _galleries(colored[: len(first)], notes)
    rows = [row for gallery in (examples, failed) for of_category in gallery.values() for row in of_category]
    drawings = _drawings(rows, notes)
    return Content(settings.title, colored, focus, against, tables, plots, examples, failed, drawings, notes)


def _plots(
    models: figures.Colored, focus: Model, against: Model | None, tables: Tables, notes: list[str]
) -> dict[str, Figure]:
    networks = [entry for entry in models if entry[0].is_network]
    plots: dict[str, Figure | None] = {
        "learning_curves": figures.learning_curves(networks),
        "precision_recall": figures.precision_recall(_counts(models, notes), models),
        "reliability": figures.reliability(models),
    }
    if against and tables.difference:
        plots["scatter"] = figures.scatter(focus, against)
        shown = {name: rows for name, rows in tables.difference.items() if name not in REPEATED}
        plots["differences"] = forest_figure(shown, focus.label, against.label)
    else:
        notes.append("There is one model only, so nothing is compared.")
    without = [
        model.label
        for model, _ in networks
        if not any((facts.get("trained") or {}).get("history") for facts in model.evaluations.facts)
    ]
    if without:
        notes.append(
            f"No learning curve of {_listed(without)}: the evaluation knows no history of the training."
        )
    return {name: figure for name, figure in plots.items() if figure is not None}


def _counts(models: figures.Colored, notes: list[str]) -> dict[str, dict[str, NDArray[np.int64]]]:
    """Counts of the precision-recall curves by label and category, over the seeds that have them."""
    counts: dict[str, dict[str, NDArray[np.int64]]] = {}
    for model, _ in models:
        for folder in model.folders:
            for category, counts_2K in _curves(folder / "curves.json", model.evaluations.categories).items():
                of_model = counts.setdefault(model.label, {})
                of_model[category] = of_model.get(category, 0) + counts_2K
    without = [model.label for model, _ in models if model.label not in counts]
    if without:
        notes.append(
            f"No precision-recall curve of {_listed(without)}: there is no curves.json; evaluate again."
        )
    return counts


def _curves(path: Path, categories: Iterable[str]) -> dict[str, NDArray[np.int64]]:
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if not np.allclose(content["levels"], LEVELS):
            raise ValueError("levels")
        of_category = {category: content["categories"][category] for category in categories}
        counts = {
            category: np.array([sides["empty"], sides["occupied"]], dtype=np.int64)
            for category, sides in of_category.items()
        }
        if any(of.shape != (2, len(LEVELS) + 1) or (of < 0).any() for of in counts.values()):
            raise ValueError("counts")
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise UserError(f"{path}: is damaged or of another version; evaluate the checkpoint again") from error
    return counts


def _galleries(
    models: figures.Colored, notes: list[str]
) -> tuple[dict[str, list[GalleryRow]], dict[str, list[GalleryRow]]]:
    """Examples and failures among the views that the first seeds of all these models kept."""
    kept = [read_kept_views(model.folders[0]) for model, _ in models]
    without = [model.label for (model, _), views in zip(models, kept, strict=True) if not views]
    if without:
        notes.append(f"No meshes of {_listed(without)}: no views were kept; evaluate again with meshes=1.")
        return {}, {}
    place_of = {key: place for place, key in enumerate(models[0][0].evaluations.keys)}
    keys = [key for key in place_of if all(key in views for views in kept)]
    places = [place_of[key] for key in keys]
    iou = [model.evaluations.values[METRIC].mean(axis=0)[places] for model, _ in models]
    best = best_median_worst(keys, iou[0])
    shown = [choice.key for choices in best.values() for choice in choices]
    failed = failures(keys, iou[0], iou[1] if len(iou) > 1 else None, shown)
    examples, lowest = (
        {
            category: [
                make_row(choice, [views[choice.key] for views in kept[::-1]], models[::-1])
                for choice in choices
            ]
            for category, choices in chosen.items()
        }
        for chosen in (best, failed)
    )
    return examples, lowest


def _drawings(rows: Sequence[GalleryRow], notes: list[str]) -> dict[GalleryRow, list[Image.Image]] | None:
    try:
        return {row: row.drawings() for row in tqdm(rows, desc="drawing", unit="row", leave=False)}
    except UserError as error:
        notes.append(f"No still pictures of the meshes: {error}")
        return None


def _listed(labels: Sequence[str]) -> str:
    return "; ".join(labels)
