"""``metrics.json``: the result of a run as a file.

Keys of every ``metrics.json``:
    schema, protocol: versions of the file's form and of what the metrics mean.
    stereo_occ, commit, dirty, torch, python, packages, cpu, threads: code, versions and hardware.
    seconds: wall-clock since the start.

Of a training besides:
    parameters: number of trained parameters of the model.
    threshold: of the decision, chosen on the validation objects at the best step.
    best: the entry of ``history`` with the highest ``val/iou``.
    history: one entry per validation with ``step``, ``val/loss`` and the ``val/...`` metrics of the protocol. A value
        that is not finite is null and named in ``not_finite``.

Those of an evaluation are in :mod:`stereo_occ.evaluate`.
"""

import json
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightning.pytorch import Callback, LightningModule, Trainer

from stereo_occ.provenance import environment
from stereo_occ.task import OccupancyTask
from stereo_occ.writing import write_json


class WriteMetrics(Callback):
    """Rewrites ``metrics.json`` after every validation."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.history: list[dict[str, Any]] = []
        self.start = time.monotonic()

    def state_dict(self) -> dict[str, Any]:
        return {"history": self.history}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        self.history = state_dict["history"]

    def on_validation_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        assert isinstance(pl_module, OccupancyTask)
        if trainer.sanity_checking:
            return
        values = {
            name: float(value) for name, value in trainer.callback_metrics.items() if name.startswith("val/")
        }
        self.history = [entry for entry in self.history if entry["step"] < trainer.global_step]
        self.history.append({"step": trainer.global_step, **without_nan(values)})
        best = max(self.history, key=lambda entry: entry["val/iou"])
        write_json(
            self.path,
            environment()
            | {
                "parameters": sum(p.numel() for p in pl_module.model.parameters() if p.requires_grad),
                "seconds": round(time.monotonic() - self.start, 1),
                "threshold": best["val/threshold"],
                "best": best,
                "history": self.history,
            },
        )


def training_history(checkpoint_path: Path, checkpoint: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The validations of the training that wrote a checkpoint, as in its ``metrics.json``; empty if they are not known.

    All of them where that file is beside the checkpoint and has its step, else those up to the checkpoint.
    """
    callbacks: dict[str, Any] = checkpoint.get("callbacks", {})
    own: list[dict[str, Any]] = callbacks.get(WriteMetrics.__name__, {}).get("history", [])
    try:
        content = json.loads((checkpoint_path.parent / "metrics.json").read_text())
        whole: list[dict[str, Any]] = content["history"]
        return whole if own and own == whole[: len(own)] else own
    except (OSError, ValueError, KeyError, TypeError):
        return own


def best_iou(path: Path) -> float:
    """The highest ``val/iou`` of a training, from its ``metrics.json``."""
    return float(json.loads(path.read_text(encoding="utf-8"))["best"]["val/iou"])


def without_nan(values: Mapping[str, float]) -> dict[str, Any]:
    """The values with null for those that are not finite, whose names are then listed under ``not_finite``."""
    lost = [name for name, value in values.items() if not math.isfinite(value)]
    return {**values, **dict.fromkeys(lost), **({"not_finite": lost} if lost else {})}
