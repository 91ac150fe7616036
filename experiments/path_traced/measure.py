"""What ``reconstruct`` makes of the path-traced pairs, told masks, both boxes or the left box alone.

    python -m experiments.path_traced.measure --root DIR --checkpoint field

DIR holds the real objects; the pairs are rendered before, by ``experiments.path_traced.render``. Writes
``results.json``, ``table.md``, ``per_object.csv`` and ``pairs.png`` into ``--output``, this folder if it is not given.
"""

import argparse
import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from tqdm import tqdm
from trimesh import Trimesh

from experiments import cells
from experiments.path_traced.pairs import OUTPUT, RenderedPair, read_pairs
from experiments.path_traced.real_objects import real_objects
from experiments.path_traced.sheet import panel, sheet
from experiments.whole_pairs import COLUMNS, Photographs, Told, compared, reconstructed
from stereo_occ.errors import UserError
from stereo_occ.packaged import DEFAULT
from stereo_occ.provenance import environment
from stereo_occ.reconstructor import Reconstructor
from stereo_occ.shapes.shape import CATEGORIES

HERE = Path(__file__).parent

WAYS: dict[str, Callable[[Photographs], Told]] = {
    "masks": lambda p: {"masks": tuple(p.mask_2HW)},
    "both boxes": lambda p: {"boxes": tuple(p.boxes_24.tolist())},
    "left box alone": lambda p: {"boxes": (p.boxes_24[0].tolist(), None)},
}

#: What the pictures show of, and how many of each category.
SHOWN, SHOWN_OF_EACH = "both boxes", 4


@dataclass(frozen=True)
class Row:
    """What became of a pair in one way: the values of ``COLUMNS``, or the IoU 0 and why there is no mesh."""

    category: str
    object_id: str
    view: int
    look: str
    way: str
    values: list[float]
    failure: str = ""


def measure_pair(reconstruct: Reconstructor, pair: RenderedPair, way: str) -> tuple[Row, Trimesh | None]:
    """A row, and the mesh (left camera's frame, metres) where there is one."""
    name = pair.source.category, pair.source.object_id, pair.view, pair.look, way
    try:
        mesh = reconstructed(reconstruct, pair.photographs, WAYS[way](pair.photographs)).mesh
    except UserError as error:
        return Row(*name, [0.0, *[np.inf] * 3], str(error)), None
    return Row(*name, compared(mesh, pair.photographs)), mesh


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """Mean IoU of each category and their mean; medians of errors, metres, infinite where there is no mesh."""
    means = {
        category: float(np.mean([row.values[0] for row in rows if row.category == category]))
        for category in CATEGORIES
        if any(row.category == category for row in rows)
    }
    medians = np.median([row.values[1:] for row in rows], axis=0).tolist()
    return {
        "pairs": len(rows),
        "iou": float(np.mean(list(means.values()))),
        **{f"iou/{category}": value for category, value in means.items()},
        **dict(zip(COLUMNS[1:], medians, strict=True)),
        "failed": sum(bool(row.failure) for row in rows),
    }


def table(found: dict[str, dict[str, Any]]) -> str:
    """One line for each group of rows."""
    head = (
        "told", "pairs", "`mesh_iou` (mug / bowl / bottle)", "height error", "width error", "centre error", "failed",
    )  # fmt: skip
    rows = []
    for name, values in found.items():
        parts = " / ".join(
            f"{values[key]:.2f}" if (key := f"iou/{category}") in values else "" for category in CATEGORIES
        )
        errors = [f"{1000 * values[column]:.0f} mm" for column in COLUMNS[1:]]
        iou = f"**{values['iou']:.3f}** ({parts})"
        rows.append([name, str(values["pairs"]), iou, *errors, str(values["failed"])])
    return cells.table(head, rows) + "\n"


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """A line for each pair and way."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["category", "object_id", "view", "look", "told", *COLUMNS, "failure"])
        for row in rows:
            values = [f"{value:.4f}" for value in row.values]
            writer.writerow([row.category, row.object_id, row.view, row.look, row.way, *values, row.failure])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, required=True, help="folder of the real objects")
    parser.add_argument(
        "--checkpoint", default=DEFAULT, help="name of shipped weights, best.ckpt or .safetensors"
    )
    parser.add_argument("--pairs", type=Path, default=OUTPUT, help="folder of the rendered pairs")
    parser.add_argument("--output", type=Path, default=HERE)
    parser.add_argument("--views", type=int, default=2, help="of each object")
    options = parser.parse_args()
    torch.set_num_threads(1)
    reconstruct = Reconstructor.from_checkpoint(options.checkpoint)
    pairs = list(read_pairs(options.pairs, real_objects(options.root), range(options.views)))
    rows: list[Row] = []
    shown: dict[str, list[Any]] = {category: [] for category in CATEGORIES}
    for pair in tqdm(pairs):
        for way in WAYS:
            row, mesh = measure_pair(reconstruct, pair, way)
            rows.append(row)
            if way == SHOWN and mesh is not None:
                shown[row.category].append(panel(pair.photographs, mesh))
    options.output.mkdir(parents=True, exist_ok=True)
    by_way = {way: summary([row for row in rows if row.way == way]) for way in WAYS}
    looks = sorted({row.look for row in rows})
    by_look = {
        f"{SHOWN}, {look}": summary([row for row in rows if row.way == SHOWN and row.look == look])
        for look in looks
    }
    results = {"environment": environment(), "checkpoint": options.checkpoint, **by_way, **by_look}
    (options.output / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    (options.output / "table.md").write_text(table(by_way | by_look))
    write_rows(options.output / "per_object.csv", rows)
    chosen = [panels[:: max(1, len(panels) // SHOWN_OF_EACH)][:SHOWN_OF_EACH] for panels in shown.values()]
    Image.fromarray(sheet(chosen)).save(options.output / "pairs.png", optimize=True)


if __name__ == "__main__":
    main()
