"""The tables of the path-traced pairs."""

from pathlib import Path

import numpy as np

from experiments import cells
from experiments.runs import CATEGORIES, HERE, load, rows_of
from stereo_occ.metrics.statistics import Difference, paired_bootstrap

TRACED = HERE / "path_traced"
WAYS = ("masks", "both boxes", "left box alone")
#: Weights and pictures, and where their results are.
MEASURED = {
    ("previous", "path-traced"): TRACED / "before",
    ("previous", "the project's own, without shadows"): TRACED / "before" / "own_shader",
    ("shipped", "path-traced"): TRACED,
    ("shipped", "the project's own, without shadows"): TRACED / "own_shader",
}


def reached() -> str:
    """IoU of meshes by what is told, and the errors with both boxes, of the shipped and the previous weights."""
    head = (
        "weights", "pictures", *(f"`mesh_iou`, {way}" for way in WAYS), "both boxes: mug / bowl / bottle",
        "both boxes: median errors of height, width, centre",
    )  # fmt: skip
    rows = []
    for (weights, pictures), folder in MEASURED.items():
        found = load(folder / "results.json")
        boxes = found["both boxes"]
        rows.append(
            [
                weights,
                pictures,
                *(f"{found[way]['iou']:.3f}" for way in WAYS),
                cells.parts({category: boxes[f"iou/{category}"] for category in CATEGORIES}),
                ", ".join(f"{1000 * boxes[f'{of}_error']:.0f} mm" for of in ("height", "width", "center")),
            ]
        )
    return cells.table(head, rows)


def looks() -> str:
    """With both boxes on path-traced pairs, by the look of the object."""
    now, before = (load(folder / "results.json") for folder in (TRACED, TRACED / "before"))
    rows = [
        [
            key.removeprefix("both boxes, "),
            str(values["pairs"]),
            f"{values['iou']:.3f}",
            f"{before[key]['iou']:.3f}",
        ]
        for key, values in now.items()
        if key.startswith("both boxes, ")
    ]
    return cells.table(("object", "pairs", "`mesh_iou`", "previous weights"), rows)


def less_before() -> str:
    """The shipped weights less the previous ones on path-traced pairs, with intervals over objects."""
    now, before = (_by_pair(folder / "per_object.csv") for folder in (TRACED, TRACED / "before"))
    rows = []
    for way in WAYS:
        keys = [key for key in now if key[0] == way]
        ours_1V, theirs_1V = (np.array([[side[key] for key in keys]]) for side in (now, before))
        found = paired_bootstrap(ours_1V, theirs_1V, [key[1] for key in keys], [key[2] for key in keys])
        rows.append([way, *(_bounds(found[place]) for place in (*CATEGORIES, "macro"))])
    return cells.table(("told", *CATEGORIES, "macro"), rows)


def _bounds(found: Difference) -> str:
    assert found.low is not None, "of one object alone"
    assert found.high is not None
    return cells.interval((found.difference, found.low, found.high))


def _by_pair(path: Path) -> dict[tuple[str, str, str, str], float]:
    """IoU by what is told, category, object and view."""
    return {
        (row["told"], row["category"], row["object_id"], row["view"]): float(row["iou"])
        for row in rows_of(path)
    }
