"""Make the tables of the README and of docs/metrics.md and the figures from the committed result files.

Run by ``make results``.
"""

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

HERE = Path(__file__).parent
README = HERE.parent / "README.md"
METRICS_PAGE = HERE.parent / "docs" / "metrics.md"
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
FLOORS = HERE / "floors"
BASELINES = ("visual_hull", "sgm", "mean_shape", "nearest_shape", "truth")
SHORT, RECIPE = HERE / "laptop_4k", HERE / "recipe_10k"
RUNS = {
    SHORT / "mono": "model=mono model.encoder.weights=null steps=4000",
    SHORT / "stereo": "model=stereo steps=4000",
    RECIPE / "mono_scratch": "experiment=recipe model=mono_scratch steps=10000",
    RECIPE / "plane_sweep_stereo": "experiment=recipe model=plane_sweep_stereo steps=10000",
}
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


def examples(folder: Path) -> None:
    """The first test object of each category: left | right | predicted | true."""
    rows = []
    for category in FIGURE_CATEGORIES:
        first = sorted((folder / "pictures" / category).glob("*.png"))[0]
        rows.append(np.asarray(Image.open(first)))
    Image.fromarray(np.concatenate(rows)).save(folder / "figure.png", optimize=True)


def main() -> None:
    curves()
    examples(RECIPE / "plane_sweep_stereo")
    for page, lines in ((README, table()), (METRICS_PAGE, floors())):
        text = page.read_text()
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        page.write_text(f"{before}{BEGIN}\n{lines}\n{END}{after}")


if __name__ == "__main__":
    main()
