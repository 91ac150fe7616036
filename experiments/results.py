"""Make the README's table and the figures from the committed result files: ``make results``."""

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

HERE = Path(__file__).parent
README = HERE.parent / "README.md"
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
RUNS = {
    "stereo": "python -m stereo_occ.train model=stereo steps=4000",
    "mono": "python -m stereo_occ.train model=mono model.encoder.weights=null steps=4000",
}
METRICS = {"iou": "-", "iou_bbox": "--", "iou_unrotated": ":"}
FIGURE_CATEGORIES = ("mug", "bowl", "bottle")


def table(folder: Path) -> str:
    """IoU of each run's best state as a Markdown table, with the command of each row."""
    lines = [
        "| model | parameters | test `iou` (mug / bowl / bottle) | `iou_bbox` | `iou_unrotated` | real objects `iou` |",
        "|---|---|---|---|---|---|",
    ]
    for name, command in RUNS.items():
        test, real = (json.loads((folder / name / f"{where}.json").read_text()) for where in ("test", "real"))
        metrics = test["metrics"]
        parts = " / ".join(f"{metrics[f'test/iou/{category}']:.2f}" for category in FIGURE_CATEGORIES)
        lines.append(
            f"| `{command}` | {test['parameters'] / 1e6:.1f} M | **{metrics['test/iou']:.3f}** ({parts}) | "
            f"{metrics['test/iou_bbox']:.3f} | {metrics['test/iou_unrotated']:.3f} | "
            f"{real['metrics']['test/iou']:.3f} |"
        )
    return "\n".join(lines)


def curves(folder: Path) -> None:
    """The three metrics along training, on test and on real objects."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
    for axis, where in zip(axes, ("test", "real"), strict=True):
        for color, name in enumerate(RUNS):
            curve: list[dict[str, Any]] = json.loads((folder / name / "curve.json").read_text())
            for metric, style in METRICS.items():
                values = [entry[where][f"test/{metric}"] for entry in curve]
                steps = [entry["step"] for entry in curve]
                axis.plot(steps, values, style, color=f"C{color}", label=f"{name} {metric}")
        axis.set(title=f"{where} objects", xlabel="step", ylim=(0, 1))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("macro IoU")
    axes[1].legend(fontsize=7)
    figure.savefig(folder / "curves.png", dpi=110)


def examples(folder: Path, name: str) -> None:
    """The first test object of each category: left | right | predicted | true."""
    rows = []
    for category in FIGURE_CATEGORIES:
        first = sorted((folder / name / "pictures" / category).glob("*.png"))[0]
        rows.append(np.asarray(Image.open(first)))
    Image.fromarray(np.concatenate(rows)).save(folder / "figure.png", optimize=True)


def main() -> None:
    folder = HERE / "laptop_4k"
    curves(folder)
    examples(folder, "stereo")
    text = README.read_text()
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    README.write_text(f"{before}{BEGIN}\n{table(folder)}\n{END}{after}")


if __name__ == "__main__":
    main()
