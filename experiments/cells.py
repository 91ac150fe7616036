"""Tables in Markdown and what stands in their cells."""

from collections.abc import Iterable, Mapping, Sequence

from experiments.runs import CATEGORIES


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table, its columns as in ``head``."""
    lines = [f"| {' | '.join(row)} |" for row in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]])


def iou(metrics: Mapping[str, float]) -> str:
    """IoU, macro and of each category."""
    parts = " / ".join(f"{metrics[f'test/iou/{category}']:.2f}" for category in CATEGORIES)
    return f"**{metrics['test/iou']:.3f}** ({parts})"


def size(metrics: Mapping[str, float]) -> str:
    """Errors of the mesh's height and width."""
    return ", ".join(f"{metrics[f'test/{side}_error'] * 1000:.0f} mm" for side in ("height", "width"))


def parts(row: Mapping[str, str | float]) -> str:
    """The value of each category."""
    return " / ".join(f"{float(row[category]):.2f}" for category in CATEGORIES)


def interval(value: Sequence[float] | None, digits: int = 3) -> str:
    """A difference and where it lies; empty where there is none."""
    if value is None:
        return ""
    difference, low, high = value
    return f"{difference:+.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def intervals(metric: str, found: Mapping[str, Sequence[float]]) -> list[str]:
    """The metric's name, and its value for each category and macro."""
    return [f"`{metric}`", *(interval(found.get(column)) for column in (*CATEGORIES, "macro"))]
