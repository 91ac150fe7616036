"""The Markdown version of the page, with its figures as PNG in a folder beside it."""

import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import fill

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from stereo_occ.report.content import Content
from stereo_occ.report.figures import STYLE, png
from stereo_occ.report.gallery import GalleryRow, title_of
from stereo_occ.report.tables import PUBLISHED, Cell, Row
from stereo_occ.writing import write_whole

TITLES = {
    "differences": "Differences in every metric",
    "scatter": "Object by object",
    "learning_curves": "Learning curves",
    "precision_recall": "Precision and recall",
    "reliability": "Reliability of the probability",
}


def write_markdown(content: Content, path: Path) -> None:
    """Write ``NAME.md`` and ``NAME_figures/*.png``."""
    folder = path.with_name(f"{path.stem}_figures")
    drawn = content.drawings is not None
    galleries = {"figure_5": content.examples, "failures": content.failures} if drawn else {}
    for name, figure in content.plots.items():
        write_whole(folder / f"{name}.png", png(figure))
    for name, rows in galleries.items():
        if rows:
            write_whole(folder / f"{name}.png", _contact_sheet(content, rows))
    text = "\n".join(_lines(content, folder.name, [name for name, rows in galleries.items() if rows]))
    write_whole(path, f"{text}\n".encode())


def _lines(content: Content, folder: str, galleries: Sequence[str]) -> Iterator[str]:
    facts, table = content.focus.facts, content.tables
    yield f"# {content.title}\n"
    yield (
        f"{facts['objects']} objects of the subset `{facts['subset']}`, {facts['views']} poses each, "
        f"{facts['points']:,} points per view. In brackets 95 % intervals from a bootstrap that draws whole "
        f"objects and seeds; a star marks a difference whose interval leaves out 0.\n"
    )
    yield from (f"> {note}\n" for note in content.notes)
    yield "## Table 1: volumetric IoU\n"
    yield from _table(["model", "seeds", *(column.replace("iou/", "") for column in table.columns)], [
        [row.label, str(len(row.model.folders)) if row.model else "", *_texts(row, table.columns)]
        for row in table.table_1
    ])  # fmt: skip
    published = ", ".join(f"{name.lower()} {value:.4f}" for name, value in PUBLISHED.items())
    yield f"\nThe paper's Table 1 ({published}) is of ShapeNet's objects and not comparable.\n"
    if "figure_5" in galleries:
        yield "## Figure 5: pair, predictions, truth\n"
        yield (
            f"By rule: of the first view of each test object, those in which {content.focus.label} has the highest, "
            f"the median and the lowest `iou` of the category.\n"
        )
        yield f"![Pairs, predicted and true meshes]({folder}/figure_5.png)\n"
    if "failures" in galleries:
        yield "## Failures\n"
        behind = ", and where the model is farthest behind the other" if content.against else ""
        yield f"The lowest `iou` of the views not shown above{behind}.\n"
        yield f"![Failures]({folder}/failures.png)\n"
    for name, title in TITLES.items():
        if name in content.plots:
            yield f"## {title}\n\n![{title}]({folder}/{name}.png)\n\n{content.caption(name)}\n"
    yield "## All metrics\n"
    labels = [model.label for model, _ in content.models] + (["difference"] if content.against else [])
    yield from _table(["metric", *labels], [
        [f"`{row.label}`", *_texts(row, labels)] for row in table.every_metric
    ])  # fmt: skip
    yield "\n`docs/metrics.md` defines each."


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield f"|{'---|' * len(head)}"
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _texts(row: Row, columns: Sequence[str]) -> list[str]:
    return [_text(row.cells.get(column)) for column in columns]


def _text(cell: Cell | None) -> str:
    return "" if cell is None else f"{cell.text} {cell.interval}{' *' if cell.clear else ''}"


@mpl.rc_context(STYLE)
def _contact_sheet(content: Content, gallery: Mapping[str, Sequence[GalleryRow]]) -> bytes:
    """All rows of a gallery as one PNG: left, right, predictions, truth."""
    rows = [row for of_category in gallery.values() for row in of_category]
    columns = 2 + len(rows[0].panels)
    figure = Figure(figsize=(1.5 * columns + 0.9, 1.72 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(rows), columns, squeeze=False)
    assert content.drawings is not None
    for row, of_row in zip(rows, axes, strict=True):
        images = [*row.pictures, *content.drawings[row]]
        captions = ["left", "right", *(panel.caption for panel in row.panels)]
        for axis, image, caption in zip(of_row, images, captions, strict=True):
            axis.imshow(image, interpolation="nearest")
            axis.set_xticks([])
            axis.set_yticks([])
            axis.spines[:].set_visible(False)
            axis.set_xlabel(fill(caption, 28), fontsize=6.5, color="#3b424c", labelpad=2)
        of_row[0].set_ylabel(f"{row.choice.key[0]}\n{row.choice.reason}", fontsize=7.5)
        of_row[0].set_title(title_of(row.choice.key), fontsize=6, loc="left", color="#6b727c", pad=2)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=120)
    return file.getvalue()
