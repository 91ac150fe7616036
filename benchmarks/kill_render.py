"""Kill renderings at random moments until they are done, and compare every byte with renderings left alone.

Half of the kills hit the command alone, half it and its rendering processes; both are SIGKILL.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.processes import finish
from stereo_occ.provenance import environment


def start(folder: Path, overrides: list[str], workers: int) -> "subprocess.Popen[bytes]":
    """The command in a process group of its own."""
    command = [sys.executable, "-m", "stereo_occ.render", *overrides, f"workers={workers}", "progress=false"]
    return subprocess.Popen(
        [*command, f"paths.data={folder}", f"paths.outputs={folder.parent}"],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def files(folder: Path) -> dict[str, bytes]:
    """Everything in ``folder``."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def shards(folder: Path) -> dict[Path, int]:
    """When each shard was written."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}


class Rendering:
    """One data set that is rendered by as many processes as it takes.

    Attributes:
        redone: shards that were there and were written again.
    """

    def __init__(self, folder: Path, overrides: list[str]) -> None:
        self.folder, self.overrides = folder, overrides
        self.redone = 0
        self.before: dict[Path, int] = {}
        self.began = self.seconds = 0.0

    def go_on(self, wait_for_work: bool) -> None:
        """Start the command; ``wait_for_work``: come back when it writes its first file, or has ended."""
        self.before, self.began = shards(self.folder), time.perf_counter()
        self.process = start(self.folder, self.overrides, 2)
        while wait_for_work and self.process.poll() is None and not any(self.folder.rglob("*.part")):
            time.sleep(0.02)

    def kill_within(self, seconds: float, group: bool) -> bool:
        """Kill the command, or its whole process group, unless it ends before."""
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            (os.killpg if group else os.kill)(self.process.pid, signal.SIGKILL)
            self.process.communicate()
            self.seconds = time.perf_counter() - self.began
            time.sleep(1)  # the rendering processes end with the command
            return True
        return False

    def left(self) -> dict[str, Any]:
        """What the command left."""
        after = shards(self.folder)
        self.redone += sum(after[path] != written for path, written in self.before.items())
        partial = len(list(self.folder.rglob("*.part")))
        return {"seconds": round(self.seconds, 1), "shards": len(after), "partial": partial}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--objects", type=int, default=4, help="of each category")
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="JSON file for the table")
    options = parser.parse_args()
    counts = ",".join(f"{name}:{options.objects}" for name in ("mug", "bowl", "bottle"))
    overrides = [f"scale.counts={{{counts}}}", f"data.views={options.views}"]
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as root:
        seconds, renderings, redone = [], [], 0
        for workers in (1, 2, 3):
            folder = Path(root) / f"alone_{workers}"
            began = time.perf_counter()
            finish(start(folder, overrides, workers))
            seconds.append(time.perf_counter() - began)
            renderings.append(files(folder))
        same = all(rendering == renderings[0] for rendering in renderings)
        print(
            f"left alone, workers 1, 2, 3: {len(renderings[0])} files, {'identical' if same else 'DIFFERENT'}"
        )

        killed = Rendering(Path(root) / "killed_0", overrides)
        within, ended = seconds[1], 0
        rows: list[dict[str, Any]] = []
        print(f"{'kill':>4} {'run':>4} {'after s':>8} {'whom':>8} {'shards':>7} {'partial files':>14}")
        while len(rows) < options.kills or killed.folder.exists():
            killed.go_on(wait_for_work=rng.random() >= 0.15)
            group = rng.random() < 0.5
            if len(rows) < options.kills and killed.kill_within(rng.uniform(0, within), group):
                row = {"run": ended, "whom": "group" if group else "command"} | killed.left()
                rows.append(row)
                print(f"{len(rows):>4} {ended:>4} {row['seconds']:>8.1f} {row['whom']:>8} {row['shards']:>7} "
                      f"{row['partial']:>14}", flush=True)  # fmt: skip
                continue
            finish(killed.process)
            killed.left()
            same = same and files(killed.folder) == renderings[0]
            redone += killed.redone
            ended, within = ended + 1, max(1.0, 0.7 * within)  # the machine is faster than it was
            killed = Rendering(Path(root) / f"killed_{ended}", overrides)
        print(f"in the end {'identical' if same else 'DIFFERENT'}, {ended} runs; "
              f"{redone} finished objects rendered again")  # fmt: skip
        if options.output:
            content = {
                "files": len(renderings[0]),
                "runs": ended,
                "kills": rows,
                "identical": same,
                "rendered again": redone,
            }
            options.output.parent.mkdir(parents=True, exist_ok=True)
            options.output.write_text(json.dumps(environment() | content, indent=2) + "\n")
        sys.exit(0 if same and not redone else 1)


if __name__ == "__main__":
    main()
