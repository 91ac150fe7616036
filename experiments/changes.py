"""What changes of single settings do to training: ``changes.py TABLE.csv BASE RUN...``, all run folders.

A row per validation: the settings in which the run's ``config.yaml`` differs from the base's, step, IoU, seconds per
step. The seconds are of a machine that did other things too; they order costs, no more.
"""

import csv
import sys
from pathlib import Path

import yaml
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from stereo_occ.flat import flat

NOT_CHANGES = (
    "data",
    "steps",
    "validation",
    "logger",
    "paths",
    "trainer.threads",
    "scale.steps",
    "experiment",
)
SCALARS = ("val/iou", "val/iou/mug", "val/iou/bowl", "val/iou/bottle")


def changes(base: Path, run: Path) -> str:
    """The run's settings that are not the base's."""
    old, new = (flat(yaml.safe_load((folder / "config.yaml").read_text())) for folder in (base, run))
    changed = {k: v for k, v in new.items() if old.get(k) != v and not k.startswith(NOT_CHANGES)}
    return " ".join(f"{key}={value}".replace(" ", "") for key, value in changed.items())


def curve(run: Path) -> list[list[str]]:
    """Step, IoUs and seconds per step of each validation."""
    events = EventAccumulator(str(run / "tensorboard"), size_guidance={"scalars": 0})
    events.Reload()
    loss = events.Scalars("train/loss")
    seconds = (loss[-1].wall_time - loss[0].wall_time) / (loss[-1].step - loss[0].step)
    values = zip(*(events.Scalars(name) for name in SCALARS), strict=True)
    return [[str(v[0].step), *(f"{x.value:.4f}" for x in v), f"{seconds:.3f}"] for v in values]


def main(table: Path, base: Path, *runs: Path) -> None:
    with table.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["changed", "step", "iou", "mug", "bowl", "bottle", "seconds_per_step"])
        for run in (base, *runs):
            writer.writerows([changes(base, run), *row] for row in curve(run))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
