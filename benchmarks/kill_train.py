"""Kill a training at random moments until it is done, and compare all that it leaves with a training left alone.

The same command goes on each time from the latest checkpoint. Compared to the bit: weights, state of the optimiser and
of the schedule, the history in metrics.json, every scalar in TensorBoard with its step and value (the loss of each step
tells the data that it saw), best.ckpt.
"""

import argparse
import json
import logging
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from benchmarks.processes import finish
from stereo_occ.provenance import environment

# A resumed run purges what the killed part had logged, and says so.
logging.getLogger("tensorboard").setLevel(logging.ERROR)

#: A run of seconds with every part that has a state: moving average, schedule, augmentation, auxiliary heads.
RUN = [
    "model=pixel_stereo", "model/encoder=light", "model.encoder.channels=8", "model.encoder.widths=[8,8,8,8]",
    "model.encoder.blocks=[1,1,1,1]", "model.groups=2", "model.code_size=8", "model.hidden=8", "model.blocks=1",
    "averaging=ema", "augmentation=full", "auxiliary=mask_depth", "scheduler=cosine", "optimizer=adamw",
    "batch_size=4", "points=64", "progress=false", "workers=1", "data.image_side=32", "data.views=2",
    "data.pool_size=2000", "scale.counts={mug:3,bowl:3,bottle:3}", "validation.views=2", "validation.points=500",
    "logger.interval=1", "logger.examples=1", "logger.mesh_resolution=8",
]  # fmt: skip


def start(folder: Path, data: Path, steps: int) -> "subprocess.Popen[bytes]":
    schedule = [f"steps={steps}", f"validation.interval={steps // 4}", "validation.checkpoint_interval=3"]
    command = [
        sys.executable,
        "-m",
        "stereo_occ.train",
        *RUN,
        *schedule,
        f"paths.data={data}",
        f"hydra.run.dir={folder}",
    ]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def left_behind(folder: Path) -> dict[str, Any]:
    """All that a finished run must share with another of the same command."""
    events = EventAccumulator(str(folder / "tensorboard"), size_guidance={"scalars": 0})
    events.Reload()
    found: dict[str, Any] = {
        "TensorBoard": {
            tag: [(event.step, event.value) for event in events.Scalars(tag)]
            for tag in events.Tags()["scalars"]
        },
        "metrics.json": json.loads((folder / "metrics.json").read_text())["history"],
    }
    for name in ("last.ckpt", "best.ckpt"):
        checkpoint = torch.load(folder / name, weights_only=True)
        for part in ("state_dict", "optimizer_states", "lr_schedulers", "global_step", "stereo_occ"):
            found[f"{name}: {part}"] = checkpoint[part]
    return found


def same(a: Any, b: Any) -> bool:
    """Whether nested plain values and tensors are equal to the bit."""
    if isinstance(a, torch.Tensor):
        return isinstance(b, torch.Tensor) and a.dtype == b.dtype and torch.equal(a, b)
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


def begins(process: "subprocess.Popen[bytes]", folder: Path) -> None:
    """Wait until the process is about to train, which it notes in its folder, or has ended."""
    noted, started = folder / "config.yaml", time.time()
    while process.poll() is None and not (noted.exists() and noted.stat().st_mtime >= started):
        time.sleep(0.02)


def step_of(checkpoint: Path) -> int | None:
    """None where there is no checkpoint yet; one that is half written would raise."""
    return int(torch.load(checkpoint, weights_only=True)["global_step"]) if checkpoint.exists() else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--steps", type=int, default=120, help="of a run, a multiple of 4")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="JSON file for the table")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    rows: list[dict[str, Any]] = []
    differing: set[str] = set()
    with tempfile.TemporaryDirectory() as root:
        data = Path(root) / "data"
        finish(start(Path(root) / "rendered", data, 4))
        began = time.perf_counter()
        process = start(Path(root) / "alone", data, options.steps)
        begins(process, Path(root) / "alone")
        start_up = time.perf_counter() - began
        finish(process)
        seconds = time.perf_counter() - began - start_up
        alone = left_behind(Path(root) / "alone")
        print(f"left alone: {start_up:.0f} + {seconds:.0f} s, {len(alone['TensorBoard'])} curves")
        print(
            f"{'kill':>4} {'run':>4} {'after s':>8} {'went on from':>13} {'saved':>6} {'partial files':>14}"
        )
        run, within = 0, seconds
        while len(rows) < options.kills:
            folder = Path(root) / f"killed_{run}"
            before = step_of(folder / "last.ckpt")
            process = start(folder, data, options.steps)
            began = time.perf_counter()
            if rng.random() < 0.15:  # before it trains
                wait = rng.uniform(0, start_up)
            else:
                begins(process, folder)
                wait = rng.uniform(0, within)
            try:
                process.wait(wait)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.communicate()
                after = time.perf_counter() - began
                row = {
                    "run": run, "seconds": round(after, 1), "from": before, "latest": step_of(folder / "last.ckpt"),
                    "partial": len(list(folder.rglob("*.part"))) if folder.exists() else 0,
                }  # fmt: skip
                rows.append(row)
                print(f"{len(rows):>4} {run:>4} {after:>8.1f} {row['from']!s:>13} {row['latest']!s:>6} "
                      f"{row['partial']:>14}", flush=True)  # fmt: skip
            else:
                finish(process)
                differing |= compared(folder, alone)
                run, within = run + 1, max(1.0, 0.7 * within)  # the machine is faster than it was
        if (Path(root) / f"killed_{run}").exists():
            finish(start(Path(root) / f"killed_{run}", data, options.steps))
            differing |= compared(Path(root) / f"killed_{run}", alone)
            run += 1
    print(f"in the end {'identical' if not differing else f'DIFFERENT: {sorted(differing)}'}, {run} runs")
    if options.output:
        compared_things = sorted(alone)
        content = {"steps": options.steps, "runs": run, "kills": rows, "compared": compared_things}
        content |= {
            "different": sorted(differing),
            "seconds to start": round(start_up, 1),
            "seconds": round(seconds, 1),
        }
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(environment() | content, indent=2) + "\n")
    sys.exit(1 if differing else 0)


def compared(folder: Path, alone: dict[str, Any]) -> set[str]:
    """What differs from the run left alone."""
    found = left_behind(folder)
    different = {name for name in alone if not same(found[name], alone[name])}
    partial = [path.name for path in folder.rglob("*.part")]
    return different | set(partial)


if __name__ == "__main__":
    main()
