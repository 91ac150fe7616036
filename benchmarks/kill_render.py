"""Kill a rendering at random moments until it is done, and compare every byte with renderings left alone.

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


def finish(process: "subprocess.Popen[bytes]") -> None:
    """Wait; stop if it failed."""
    error = process.communicate()[1].decode()
    if process.returncode:
        sys.exit(error)


def files(folder: Path) -> dict[str, bytes]:
    """Everything in ``folder``."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def shards(folder: Path) -> dict[Path, int]:
    """When each shard was written."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}


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
        seconds, renderings = [], []
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

        folder = Path(root) / "killed"
        redone, rows = 0, []
        print(f"{'kill':>4} {'after s':>8} {'whom':>8} {'shards':>7} {'partial files':>14}")
        for kill in range(options.kills):
            before = shards(folder)
            process = start(folder, overrides, 2)
            wait = rng.uniform(0, 0.6 * seconds[1])
            time.sleep(wait)
            group = rng.random() < 0.5
            (os.killpg if group else os.kill)(process.pid, signal.SIGKILL)
            process.communicate()
            time.sleep(1)  # the rendering processes end with the command
            after = shards(folder)
            redone += sum(after[path] != written for path, written in before.items())
            partial = len(list(folder.rglob("*.part")))
            whom = "group" if group else "command"
            rows.append({"seconds": round(wait, 1), "whom": whom, "shards": len(after), "partial": partial})
            print(f"{kill + 1:>4} {wait:>8.1f} {whom:>8} {len(after):>7} {partial:>14}", flush=True)
        before = shards(folder)
        finish(start(folder, overrides, 2))
        redone += sum(shards(folder)[path] != written for path, written in before.items())
        same = same and files(folder) == renderings[0]
        print(f"in the end {'identical' if same else 'DIFFERENT'}; {redone} finished objects rendered again")
        if options.output:
            content = {
                "files": len(renderings[0]),
                "kills": rows,
                "identical": same,
                "rendered again": redone,
            }
            options.output.parent.mkdir(parents=True, exist_ok=True)
            options.output.write_text(json.dumps(environment() | content, indent=2) + "\n")
        sys.exit(0 if same and not redone else 1)


if __name__ == "__main__":
    main()
