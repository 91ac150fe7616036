"""What thin walls make of an IoU: that of every test object beside the thickness of its walls.

    python -m experiments.walls.walls DATA_FOLDER

DATA_FOLDER holds the shards that the models of ``experiments/recipe_10k`` were measured on. A wall of thickness t whose
prediction, as thick, lies e beside it has an IoU of (t - e) / (t + e), so an IoU of q says e = t (1 - q) / (1 + q). The
thickness is twice the volume over the area, which for a solid is a measure of its size. That e is a shift with the same
IoU, not a measured one: a wall may also be too thick, or missing. How far surfaces are apart is measured by the Chamfer
distance, which is put beside it. Writes ``walls.csv`` and ``walls.json`` beside this file and draws ``walls.png``.
"""

import csv
import json
import sys
from collections import defaultdict
from dataclasses import dataclass
from math import radians, tan
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from stereo_occ.data.shard import Shard

HERE = Path(__file__).parent
MODELS = {"mono_scratch": "mono", "plane_sweep_stereo": "plane sweep"}
MARKERS = {"mug": "o", "bowl": "s", "bottle": "^"}
PIXEL = 2 * tan(radians(30)) / 64  # metres on the plane through the object, at 1 m
SOLID = 4.0  # pixels; what is thicker is no wall


def per_object(model: str, metric: str) -> dict[tuple[str, str], float]:
    """Mean over the views of each test object that have it, by category and name."""
    values = defaultdict(list)
    path = HERE.parent / "recipe_10k" / model / "test_per_object.csv"
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            if row[metric]:
                values[row["category"], row["object_id"]].append(float(row[metric]))
    return {key: float(np.mean(views)) for key, views in values.items()}


def thickness(shard: Path) -> float:
    """Of an object's walls in the paper's placement, pixels."""
    with Shard(shard) as opened:
        mesh = opened.mesh
    unit = np.linalg.norm(mesh.extents)
    return float(2 * mesh.volume / mesh.area / unit / PIXEL)


def offset(pixels_N: np.ndarray, iou_N: np.ndarray) -> float:
    """Median over objects of the shift of a wall that has that IoU, pixels."""
    return float(np.median(pixels_N * (1 - iou_N) / (1 + iou_N)))


@dataclass(frozen=True)
class Objects:
    """The test objects: category, name, thickness in pixels, and each model's IoU and Chamfer distance in pixels."""

    category_N: np.ndarray
    names: list[str]
    pixels_N: np.ndarray
    iou_N: dict[str, np.ndarray]
    chamfer_N: dict[str, np.ndarray]


def read(data: Path) -> Objects:
    """The objects that the models were measured on."""
    keys = sorted(per_object("plane_sweep_stereo", "iou"))

    def values_N(model: str, metric: str) -> np.ndarray:
        values = per_object(model, metric)
        return np.array([values[key] for key in keys])

    return Objects(
        np.array([category for category, _ in keys]),
        [name for _, name in keys],
        np.array([thickness(data / category / f"{name}.h5") for category, name in keys]),
        {model: values_N(model, "iou") for model in MODELS},
        {model: values_N(model, "chamfer_l1") / PIXEL for model in MODELS},
    )


def write_table(objects: Objects) -> None:
    """A row per object."""
    with (HERE / "walls.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["category", "object_id", "wall_px", *(f"iou_{model}" for model in MODELS)])
        columns = objects.category_N, objects.names, objects.pixels_N, *objects.iou_N.values()
        for category, name, pixels, *ious in zip(*columns, strict=True):
            writer.writerow([category, name, f"{pixels:.3f}", *(f"{iou:.4f}" for iou in ious)])


def summary(objects: Objects) -> dict[str, dict[str, float]]:
    """Of each model's walls the shift of the same IoU, the Chamfer distance and the IoU, and the IoU of solids."""
    walls_N = objects.pixels_N < SOLID
    found: dict[str, dict[str, float]] = {}
    for model, iou_N in objects.iou_N.items():
        found[model] = {"shift_px": offset(objects.pixels_N[walls_N], iou_N[walls_N])}
        for category in MARKERS:
            chosen_N = walls_N & (objects.category_N == category)
            found[model][f"shift_px/{category}"] = offset(objects.pixels_N[chosen_N], iou_N[chosen_N])
            found[model][f"chamfer_px/{category}"] = float(np.median(objects.chamfer_N[model][chosen_N]))
            found[model][f"iou/{category}"] = float(iou_N[chosen_N].mean())
        found[model]["iou/solid"] = float(iou_N[~walls_N].mean())
    found["objects"] = {"walls": int(walls_N.sum()), "solid": int((~walls_N).sum())}
    return found


def draw(objects: Objects) -> None:
    """IoU against thickness, and what walls that are off would have."""
    figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
    for color, (model, label) in enumerate(MODELS.items()):
        for category, marker in MARKERS.items():
            of_N = objects.category_N == category
            axis.scatter(
                objects.pixels_N[of_N],
                objects.iou_N[model][of_N],
                s=18,
                marker=marker,
                color=f"C{color}",
                alpha=0.7,
                label=f"{label}, {category}",
            )
    line_N = np.geomspace(0.5, 12, 100)
    for off in (0.1, 0.25, 0.5, 1.0):
        axis.plot(line_N, np.clip((line_N - off) / (line_N + off), 0, 1), color="0.6", lw=0.8)
        axis.annotate(f"{off} px", (12, (12 - off) / (12 + off)), fontsize=7, color="0.4", va="center")
    axis.set(
        xscale="log", xlabel="thickness of the walls, pixels", ylabel="iou, mean of 8 poses", ylim=(0, 1)
    )
    axis.legend(fontsize=7)
    figure.savefig(HERE / "walls.png", dpi=110)


def main(data: Path) -> None:
    objects = read(data)
    write_table(objects)
    draw(objects)
    (HERE / "walls.json").write_text(json.dumps(summary(objects), indent=2) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
