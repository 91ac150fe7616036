"""The figures of the README and the docs."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from experiments.runs import CATEGORIES, FLOORS, SHORT, load, metrics_of, runs_of

LINE_OF = {"iou": "-", "iou_bbox": "--", "iou_unrotated": ":"}


def curves() -> None:
    """The three metrics along training of the paper's two models, on test and on real objects."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
    for axis, where in zip(axes, ("test", "real"), strict=True):
        for color, name in enumerate(("stereo", "mono")):
            curve: list[dict[str, Any]] = load(SHORT / name / "curve.json")
            for metric, style in LINE_OF.items():
                values = [entry[where][f"test/{metric}"] for entry in curve]
                steps = [entry["step"] for entry in curve]
                axis.plot(steps, values, style, color=f"C{color}", label=f"{name} {metric}")
        axis.set(title=f"{where} objects", xlabel="step", ylim=(0, 1))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("macro IoU")
    axes[1].legend(fontsize=7)
    figure.savefig(SHORT / "curves.png", dpi=110)


def recipe_curves(family: Path) -> None:
    """Each metric along the training of each model of a family, on validation objects, beside two floors."""
    figure, axes = plt.subplots(1, len(LINE_OF), figsize=(11, 3.4), layout="constrained")
    for axis, metric in zip(axes, LINE_OF, strict=True):
        for folder in runs_of(family):
            history = load(folder / "training.json")["history"]
            steps = [entry["step"] for entry in history]
            axis.plot(steps, [entry[f"val/{metric}"] for entry in history], label=folder.name)
        for name, style in (("truth", "--"), ("mean_shape", ":")):
            level = metrics_of(FLOORS / name)[f"test/{metric}"]
            if level < 0.99:  # else at the top of the scale
                axis.axhline(level, color="grey", linestyle=style, label=f"{name} (test objects)")
        axis.set(title=metric, xlabel="step", ylim=(0, None))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("macro IoU, validation objects")
    axes[-1].legend(fontsize=7, loc="best")
    figure.savefig(family / "curves.png", dpi=110)


def examples(folder: Path) -> None:
    """The first test object of each category: left | right | predicted | true."""
    rows = []
    for category in CATEGORIES:
        first = sorted((folder / "pictures" / category).glob("*.png"))[0]
        rows.append(np.asarray(Image.open(first)))
    Image.fromarray(np.concatenate(rows)).save(folder / "figure.png", optimize=True)
