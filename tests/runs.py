"""Whole runs, in this process or another."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from samples import TINY

from stereo_occ.cli import compose_config
from stereo_occ.evaluate import evaluate
from stereo_occ.train import train


@dataclass(frozen=True)
class Workshop:
    """Tiny runs that share one folder of shards."""

    root: Path

    def overrides(self, *more: str) -> list[str]:
        return [*TINY, f"paths.data={self.root / 'data'}", *more]

    def train(self, folder: Path, *overrides: str) -> Path:
        """Train in this process; the folder of the run."""
        train(compose_config("train", self.overrides(*overrides)), folder)
        return folder

    def evaluate(self, checkpoint: Path, folder: Path, *overrides: str) -> dict[str, float]:
        """Evaluate in this process with the views, points and batches of the validation."""
        same = ["views=2", "points=500", "batch_size=4", "meshes=0", "mesh_resolution=8", "examples=1"]
        paths = [
            f"checkpoint='{checkpoint}'",
            f"paths.data={self.root / 'data'}",
            "progress=false",
            "workers=1",
        ]
        return evaluate(compose_config("evaluate", [*paths, *same, *overrides]), folder)


def program(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run ``python ARGUMENTS`` and wait for it."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, "OMP_NUM_THREADS": "1", **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
