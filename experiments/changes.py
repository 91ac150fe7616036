"""What changes of single settings do to training: ``changes.py TABLE.csv BASE RUN...``, all run folders.

A row per validation: what the run was told on its command line and the base was not, step, IoU, seconds per step. The
seconds are of a machine that did other things too; they order costs, no more.
"""

import csv
import sys
from pathlib import Path

import yaml
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from stereo_occ.run_folder import OVERRIDES

SCALARS = ("val/iou", "val/iou/mug", "val/iou/bowl", "val/iou/bottle", "val/iou_bbox")


def changes(base: Path, run: Path) -> str:
    """What the run was told that the base was not."""
    told = [yaml.safe_load((folder / OVERRIDES).read_text()) for folder in (base, run)]
    return " ".join(override for override in told[1] if override not in told[0])


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
        writer.writerow(["changed", "step", "iou", "mug", "bowl", "bottle", "iou_bbox", "seconds_per_step"])
        for run in (base, *runs):
            writer.writerows([changes(base, run), *row] for row in curve(run))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
