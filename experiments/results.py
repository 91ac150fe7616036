"""Make ``results.json``, the tables of the README and the docs and the figures from the committed result files.

Run by ``make results``. ``results.json`` has of every run ``[value, low, high]`` of its metrics per category and
macro, with the 95 % interval of the bootstrap over objects, and the paired difference from mono on the same recipe.
"""

import csv
import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from stereo_occ.metrics.statistics import Difference, paired_bootstrap

HERE = Path(__file__).parent
README = HERE.parent / "README.md"
METRICS_PAGE = HERE.parent / "docs" / "metrics.md"
EXPERIMENTS_PAGE = HERE.parent / "docs" / "experiments.md"
PROBED = (300, 600, 900, 1200, 2100, 3000)  # steps
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
FLOORS = HERE / "floors"
BASELINES = ("visual_hull", "sgm", "mean_shape", "nearest_shape", "truth")
SHORT, RECIPE, LONGER, FREE, FIELD = (
    HERE / name for name in ("laptop_4k", "recipe_10k", "recipe_20k", "free_10k", "field")
)
AIDED = "model=plane_sweep_stereo auxiliary=mask_depth"
RUNS = {
    SHORT / "mono": "model=mono model.encoder.weights=null steps=4000",
    SHORT / "stereo": "model=stereo steps=4000",
    RECIPE / "mono_scratch": "experiment=recipe model=mono_scratch steps=10000",
    RECIPE / "stereo": "experiment=recipe model=stereo steps=10000",
    RECIPE / "plane_sweep_stereo": "experiment=recipe model=plane_sweep_stereo steps=10000",
    RECIPE / "plane_sweep_stereo_aided": f"experiment=recipe {AIDED} steps=10000",
    LONGER / "plane_sweep_stereo_aided": f"experiment=recipe {AIDED} steps=20000",
    FREE / "mono_scratch": "experiment=recipe placement=free model=mono_scratch steps=10000",
    FREE / "plane_sweep_stereo_aided": f"experiment=recipe placement=free {AIDED} steps=10000",
}
#: What the others of a family are compared with.
MONO = "mono_scratch"
WITH_INTERVALS = (
    "iou", "iou_bbox", "iou_unrotated", "handle_recall", "neck_recall", "cavity_empty", "chamfer_l1",
    "height_error", "width_error",
)  # fmt: skip
METRICS = {"iou": "-", "iou_bbox": "--", "iou_unrotated": ":"}
FIGURE_CATEGORIES = ("mug", "bowl", "bottle")


def table() -> str:
    """IoU of each run's best state as a Markdown table, with the settings of each row."""
    lines = [
        "| `python -m stereo_occ.train` | parameters | test `iou` (mug / bowl / bottle) | `iou_bbox` "
        "| `iou_unrotated` | real objects, `iou` |",
        "|---|---|---|---|---|---|",
    ]
    for folder, settings in RUNS.items():
        test, real = (json.loads((folder / f"{where}.json").read_text()) for where in ("test", "real"))
        metrics = test["metrics"]
        lines.append(
            f"| `{settings}` | {test['parameters'] / 1e6:.1f} M | {_by_category(metrics)} | "
            f"{metrics['test/iou_bbox']:.3f} | {metrics['test/iou_unrotated']:.3f} | "
            f"{real['metrics']['test/iou']:.3f} ({real['objects']}) |"
        )
    return "\n".join(lines)


def summary() -> dict[str, Any]:
    """Every run's metrics with their intervals, and what it has over mono."""
    runs: dict[str, Any] = {}
    for folder in (*(folder for folder in RUNS if folder.parent != SHORT), FIELD):
        mono = folder.with_name(MONO)
        run: dict[str, Any] = {"settings": RUNS.get(folder, "experiment=field")}
        for where in ("test", "real"):
            facts = json.loads((folder / f"{where}.json").read_text())
            run["parameters"] = facts["parameters"]
            run[where] = {"objects": facts["objects"], "metrics": _differences(folder, None, where)}
            if mono in RUNS and folder != mono:
                run[where]["over mono_scratch"] = _differences(folder, mono, where)
        runs[str(folder.relative_to(HERE))] = run
    return runs


def _differences(folder: Path, other: Path | None, where: str) -> dict[str, dict[str, list[float | None]]]:
    """Of each metric ``folder`` less ``other``, or itself, per category and macro: value, low, high."""
    ours = _rows(folder / f"{where}_per_object.csv")
    theirs = None if other is None else _rows(other / f"{where}_per_object.csv")
    found: dict[str, dict[str, list[float | None]]] = {}
    for metric in WITH_INTERVALS:
        keys = [key for key, row in ours.items() if row.get(metric)]
        if not keys:
            continue
        a_1V = np.array([[float(ours[key][metric]) for key in keys]])
        b_1V = np.zeros_like(a_1V)
        if theirs is not None:
            b_1V = np.array([[float(theirs[key][metric]) for key in keys]])
        differences = paired_bootstrap(a_1V, b_1V, [key[0] for key in keys], [key[1] for key in keys])
        found[metric] = {name: _rounded(difference) for name, difference in differences.items()}
    return found


def _rows(path: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    """By category, object and view."""
    with path.open(newline="") as file:
        return {(row["category"], row["object_id"], row["view"]): row for row in csv.DictReader(file)}


def _rounded(value: Difference) -> list[float | None]:
    return [None if x is None else round(x, 4) for x in (value.difference, value.low, value.high)]


def floors() -> str:
    """What needs no training, as a Markdown table."""
    columns = ("iou_bbox", "iou_unrotated", "chamfer_l1", "f_score_2", "cavity_empty", "handle_recall")
    lines = [
        f"| baseline | test `iou` (mug / bowl / bottle) | {' | '.join(f'`{name}`' for name in columns)} | real `iou` |",
        "|---" * (3 + len(columns)) + "|",
    ]
    for name in BASELINES:
        test, real = (_metrics(FLOORS / name / f"{where}.json") for where in ("test", "real"))
        values = (f"{test[f'test/{column}']:.3f}" for column in columns)
        lines.append(f"| `{name}` | {_by_category(test)} | {' | '.join(values)} | {_by_category(real)} |")
    return "\n".join(lines)


def probes() -> str:
    """How one change moves the first steps, as a Markdown table."""
    with (HERE / "probes" / "probes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    steps = [str(step) for step in PROBED]
    lines = [
        f"| changed | {' | '.join(f'`iou` at {int(step):,}' for step in steps)} | mug / bowl / bottle, last |",
        "|---" * (2 + len(steps)) + "|",
    ]
    for changed in dict.fromkeys(row["changed"] for row in rows):
        mine = {row["step"]: row for row in rows if row["changed"] == changed}
        values = (f"{float(mine[step]['iou']):.3f}" if step in mine else "" for step in steps)
        last = [row for step, row in mine.items() if step in steps][-1]
        parts = " / ".join(f"{float(last[category]):.2f}" for category in FIGURE_CATEGORIES)
        lines.append(f"| {f'`{changed}`' if changed else 'nothing'} | {' | '.join(values)} | {parts} |")
    return "\n".join(lines)


def _metrics(path: Path) -> dict[str, float]:
    metrics: dict[str, float] = json.loads(path.read_text())["metrics"]
    return metrics


def _by_category(metrics: dict[str, float]) -> str:
    parts = " / ".join(f"{metrics[f'test/iou/{category}']:.2f}" for category in FIGURE_CATEGORIES)
    return f"**{metrics['test/iou']:.3f}** ({parts})"


def curves() -> None:
    """The three metrics along training of the paper's two models, on test and on real objects."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
    for axis, where in zip(axes, ("test", "real"), strict=True):
        for color, name in enumerate(("stereo", "mono")):
            curve: list[dict[str, Any]] = json.loads((SHORT / name / "curve.json").read_text())
            for metric, style in METRICS.items():
                values = [entry[where][f"test/{metric}"] for entry in curve]
                steps = [entry["step"] for entry in curve]
                axis.plot(steps, values, style, color=f"C{color}", label=f"{name} {metric}")
        axis.set(title=f"{where} objects", xlabel="step", ylim=(0, 1))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("macro IoU")
    axes[1].legend(fontsize=7)
    figure.savefig(SHORT / "curves.png", dpi=110)


def recipe_curves() -> None:
    """Each metric along the training of each model of the recipe, on validation objects, beside two floors."""
    figure, axes = plt.subplots(1, len(METRICS), figsize=(11, 3.4), layout="constrained")
    for axis, metric in zip(axes, METRICS, strict=True):
        for folder in (folder for folder in RUNS if folder.parent == RECIPE):
            history = json.loads((folder / "training.json").read_text())["history"]
            steps = [entry["step"] for entry in history]
            axis.plot(steps, [entry[f"val/{metric}"] for entry in history], label=folder.name)
        for name, style in (("truth", "--"), ("mean_shape", ":")):
            level = _metrics(FLOORS / name / "test.json")[f"test/{metric}"]
            if level < 0.99:  # else at the top of the scale
                axis.axhline(level, color="grey", linestyle=style, label=f"{name} (test objects)")
        axis.set(title=metric, xlabel="step", ylim=(0, None))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("macro IoU, validation objects")
    axes[-1].legend(fontsize=7, loc="lower right")
    figure.savefig(RECIPE / "curves.png", dpi=110)


def examples(folder: Path) -> None:
    """The first test object of each category: left | right | predicted | true."""
    rows = []
    for category in FIGURE_CATEGORIES:
        first = sorted((folder / "pictures" / category).glob("*.png"))[0]
        rows.append(np.asarray(Image.open(first)))
    Image.fromarray(np.concatenate(rows)).save(folder / "figure.png", optimize=True)


def main() -> None:
    (HERE / "results.json").write_text(json.dumps(summary(), indent=1) + "\n")
    curves()
    recipe_curves()
    examples(LONGER / "plane_sweep_stereo_aided")
    for page, lines in ((README, table()), (METRICS_PAGE, floors()), (EXPERIMENTS_PAGE, probes())):
        text = page.read_text()
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        page.write_text(f"{before}{BEGIN}\n{lines}\n{END}{after}")


if __name__ == "__main__":
    main()
