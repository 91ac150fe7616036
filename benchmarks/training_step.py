"""Milliseconds per training step at scale=laptop, reading included: ours in fp32 and bf16 beside a plain reference.

    python -m benchmarks.training_step --threads 2

The floor is the step's operations, forward and back, at the rate of one large bf16 matrix product on as many threads.
Reading is one batch from shards, in the training's own process.
Every way runs in a process of its own; the processes take turns, one step each, so that whatever else the machine does
hits them alike. Ours reads shards and trains as ``stereo_occ.train`` does; the reference is ``reference_step``.
"""

import argparse
import json
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf
from torch.nn.functional import binary_cross_entropy_with_logits
from torch.profiler import ProfilerActivity, profile
from torch.utils.flop_counter import FlopCounterMode
from tqdm import tqdm

from benchmarks.reference_step import ConvONet, export_npz, npz_batches
from stereo_occ.checkpoint import build_task
from stereo_occ.cli import compose_config
from stereo_occ.config import TrainConfig
from stereo_occ.data.batch import Batch
from stereo_occ.data.datamodule import PairsDataModule
from stereo_occ.memory import keep_freed_memory
from stereo_occ.shapes.shape import CATEGORIES
from stereo_occ.train import build_data

MODELS = {
    "stereo": ["model=stereo"],
    "mono": ["model=mono", "model.encoder.weights=null"],
    "pixel_stereo": ["model=pixel_stereo"],
    "plane_sweep_stereo": ["model=plane_sweep_stereo"],
    "stereo_signed": ["model=stereo_signed"],
    "plane_sweep_mono": ["model=plane_sweep_mono"],
    "plane_sweep_guided": ["model=plane_sweep_guided"],
}
WAYS = ("reference", "fp32", "bf16")
WARM_UP = 4  # steps
STEPS = 40_000  # of the paper's schedule
KINDS = 14  # of operations in a profile
BATCHES = 300  # read alone
MATRIX = 2048  # rows and columns of the product that tells the rate


@dataclass(frozen=True)
class Task:
    """What one process does."""

    overrides: list[str]
    way: str
    threads: int
    npz: Path


def serve(task: Task, pipe: Connection) -> None:
    """Do one step and send its milliseconds whenever asked; at last the peak of memory, MB."""
    torch.set_num_threads(task.threads)
    if task.way != "reference":
        keep_freed_memory()
    steps = training_steps(task)
    while pipe.recv():
        start = time.perf_counter()
        next(steps)
        pipe.send(1000 * (time.perf_counter() - start))
    pipe.send(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def training_steps(task: Task) -> Iterator[None]:
    """Training, one step at a time."""
    cfg = compose_config("train", task.overrides)
    lightning_task = build_task(cfg).train()
    model = lightning_task.model
    configured: Any = lightning_task.configure_optimizers()
    optimizer: torch.optim.Optimizer = configured["optimizer"]
    batches: Iterator[Batch] = cycle(our_data(cfg).train_dataloader())
    if task.way == "reference":
        batches = npz_batches(task.npz, cfg.batch_size, cfg.points)
        if hasattr(model, "decoder") and "decoder" in cfg.model:
            decoder = cfg.model.decoder
            model.decoder = ConvONet(cfg.model.code_size, hidden=decoder.hidden, blocks=decoder.blocks)
        optimizer = torch.optim.Adam(model.parameters(), lr=cfg.optimizer.lr)
    for batch in batches:
        queries = batch.queries["train"]
        with torch.autocast("cpu", torch.bfloat16, enabled=task.way == "bf16"):
            logits_BN = model(batch.views, queries.points_BN3).float()
        binary_cross_entropy_with_logits(logits_BN, queries.occupied_BN).backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        optimizer.zero_grad()
        yield


def profile_of(task: Task, steps: int) -> dict[str, float]:
    """Milliseconds of a step in each kind of operation, the longest first."""
    torch.set_num_threads(task.threads)
    keep_freed_memory()
    running = training_steps(task)
    for _ in range(WARM_UP):
        next(running)
    with profile(activities=[ProfilerActivity.CPU]) as seen:
        for _ in range(steps):
            next(running)
    times = {event.key: event.self_cpu_time_total / 1000 / steps for event in seen.key_averages()}
    longest = sorted(times, key=lambda name: -times[name])
    return {"all": sum(times.values()), **{name: times[name] for name in longest[:KINDS]}}


def our_data(cfg: DictConfig) -> PairsDataModule:
    """The data module of a configuration."""
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, TrainConfig)
    return build_data(typed)


def reading_time(cfg: DictConfig) -> float:
    """Median milliseconds of a batch, once its shards have been opened."""
    batches = iter(our_data(cfg).train_dataloader())
    times = []
    for _ in range(BATCHES):
        start = time.perf_counter()
        next(batches)
        times.append(1000 * (time.perf_counter() - start))
    return float(np.median(times))


def matrix_rate(threads: int) -> float:
    """Operations per millisecond of a bf16 matrix product, the best of ten."""
    torch.set_num_threads(threads)
    a, b = torch.randn(2, MATRIX, MATRIX).to(torch.bfloat16)
    times = []
    for _ in range(10):
        start = time.perf_counter()
        a @ b
        times.append(1000 * (time.perf_counter() - start))
    return 2 * MATRIX**3 / min(times)


def operations(task: Task) -> int:
    """Of the matrix products and convolutions of one step."""
    with FlopCounterMode(display=False) as counter:
        next(training_steps(task))
    return int(counter.get_total_flops())


def measure(tasks: list[Task], steps: int, label: str) -> list[tuple[float, float]]:
    """Median milliseconds and peak MB of each task, with the steps of all in turn."""
    context = multiprocessing.get_context("spawn")
    pipes, processes = [], []
    for task in tasks:
        ours, theirs = context.Pipe()
        process = context.Process(target=serve, args=(task, theirs), daemon=True)
        process.start()
        pipes.append(ours)
        processes.append(process)
    times = np.zeros((steps + WARM_UP, len(tasks)))
    for row in tqdm(times, desc=label, disable=None):
        for column, pipe in enumerate(pipes):
            pipe.send(True)
            row[column] = pipe.recv()
    peaks = []
    for pipe, process in zip(pipes, processes, strict=True):
        pipe.send(False)
        peaks.append(float(pipe.recv()))
        process.join()
    return list(zip(np.median(times[WARM_UP:], axis=0).tolist(), peaks, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--models", nargs="+", choices=MODELS, default=list(MODELS))
    parser.add_argument("--profile", action="store_true", help="also where a bf16 step's time goes")
    parser.add_argument(
        "--output", type=Path, help="JSON file for the figures, which keeps those of other models"
    )
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    figures: dict[str, Any] = {"threads": options.threads}
    with tempfile.TemporaryDirectory() as folder:
        common = [
            "scale=laptop",
            "data.views=10",
            *(f"data.counts.{category}=5" for category in CATEGORIES),
            f"paths.data={folder}",
        ]
        data = our_data(compose_config("train", common))
        export_npz(data.subset("train")[0], Path(folder) / "npz")
        figures["reading_ms"] = reading_time(compose_config("train", common))
        print(
            f"{'model':<20} {'reference':>9} {'fp32':>5} {'bf16':>5}  ms   "
            f"{'fp32':>5} {'bf16':>5} times   MB        40,000 steps in bf16   floor"
        )
        for name in options.models:
            tasks = [Task(MODELS[name] + common, way, options.threads, Path(folder) / "npz") for way in WAYS]
            floor = operations(tasks[-1]) / matrix_rate(options.threads)
            (reference, most), (fp32, _), (bf16, least) = measure(tasks, options.steps, name)
            print(
                f"{name:<20} {reference:>9.0f} {fp32:>5.0f} {bf16:>5.0f}      "
                f"{reference / fp32:>5.1f} {reference / bf16:>5.1f}         {most:.0f} to {least:.0f}  "
                f"{STEPS * bf16 / 60_000:>5.0f} min  {floor:>17.0f} ms",
                flush=True,
            )
            figures[name] = {"reference_ms": reference, "fp32_ms": fp32, "bf16_ms": bf16, "floor_ms": floor}
            if options.profile:
                figures[name]["profile_ms"] = profile_of(tasks[-1], options.steps)
                for kind, spent in figures[name]["profile_ms"].items():
                    print(f"    {spent:>6.1f} ms  {kind}")
    fastest = min(figures[name]["bf16_ms"] for name in options.models)
    reading = figures["reading_ms"]
    print(
        f"reading: {reading:.1f} ms a batch, {fastest / reading:.0f} times as fast as the fastest model's step"
    )
    if options.output:
        known = json.loads(options.output.read_text()) if options.output.exists() else {}
        same = known.get("threads") == options.threads
        options.output.write_text(json.dumps((known if same else {}) | figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
