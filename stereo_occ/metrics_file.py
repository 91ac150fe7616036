"""``metrics.json``: the result of a run as a file.

Keys:
    schema: 1.
    stereo_occ, torch, python, cpu, threads: versions and hardware.
    parameters: number of trained parameters.
    seconds: wall-clock since the start of this process's training.
    threshold: decision threshold chosen on the validation objects at the best step.
    best: the entry of ``history`` with the highest ``val/iou``.
    history: one entry per validation with ``step``, ``val/loss`` and the ``val/...`` metrics of the protocol.
"""

import json
import platform
import time
from pathlib import Path
from typing import Any

import torch
from lightning.pytorch import Callback, LightningModule, Trainer

from stereo_occ import __version__


class WriteMetrics(Callback):
    """Rewrites ``metrics.json`` after every validation."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.history: list[dict[str, float]] = []
        self.start = time.monotonic()

    def state_dict(self) -> dict[str, Any]:
        return {"history": self.history}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        self.history = state_dict["history"]

    def on_validation_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        if trainer.sanity_checking:
            return
        values = {
            name: float(value) for name, value in trainer.callback_metrics.items() if name.startswith("val/")
        }
        self.history = [entry for entry in self.history if entry["step"] < trainer.global_step]
        self.history.append({"step": trainer.global_step, **values})
        best = max(self.history, key=lambda entry: entry["val/iou"])
        write_json(
            self.path,
            environment()
            | {
                "parameters": sum(p.numel() for p in pl_module.parameters() if p.requires_grad),
                "seconds": round(time.monotonic() - self.start, 1),
                "threshold": best["val/threshold"],
                "best": best,
                "history": self.history,
            },
        )


def environment() -> dict[str, Any]:
    """Versions and hardware, for every results file."""
    return {
        "schema": 1,
        "stereo_occ": __version__,
        "torch": torch.__version__,
        "python": platform.python_version(),
        "cpu": cpu_model(),
        "threads": torch.get_num_threads(),
    }


def cpu_model() -> str:
    """The processor's own name where the system tells it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")),
        platform.machine(),
    )


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file whole or not at all."""
    temporary = path.with_suffix(".part")
    temporary.write_text(json.dumps(content, indent=2) + "\n")
    temporary.replace(path)
