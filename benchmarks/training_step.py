"""Milliseconds per training step at scale=laptop, forward, backward and optimiser, models and precisions in turn."""

import argparse
import time
from collections.abc import Callable

import numpy as np
import torch
from torch.nn.functional import binary_cross_entropy_with_logits

from stereo_occ.checkpoint import build_task
from stereo_occ.cli import compose_config
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.models.base import StereoViews

MODELS = {
    "stereo": ["model=stereo"],
    "mono": ["model=mono", "model.encoder.weights=null"],
    "pixel_stereo": ["model=pixel_stereo"],
    "plane_sweep_stereo": ["model=plane_sweep_stereo"],
}


def training_step(overrides: list[str], precision: torch.dtype) -> Callable[[], None]:
    """A step on one random batch of the scale's size."""
    cfg = compose_config("train", overrides)
    task = build_task(cfg).train()
    optimizer = task.configure_optimizers()["optimizer"]
    batch, points, side = cfg.batch_size, cfg.points, cfg.data.image_side
    rig = toed_in_rig(1.0, np.pi / 16, np.pi / 3, side)
    K_233, camera_from_rig_244 = (
        torch.tensor(np.stack([getattr(camera, name) for camera in rig.cameras]), dtype=torch.float32)
        for name in ("K", "camera_from_rig")
    )
    views = StereoViews(
        torch.rand(batch, 3, side, side),
        torch.rand(batch, 3, side, side),
        K_233.expand(batch, -1, -1, -1),
        camera_from_rig_244.expand(batch, -1, -1, -1),
    )
    points_BN3 = torch.rand(batch, points, 3) - 0.5
    occupied_BN = (torch.rand(batch, points) > 0.7).float()

    def step() -> None:
        with torch.autocast("cpu", precision, enabled=precision is not torch.float32):
            logits_BN = task.model(views, points_BN3).float()
        binary_cross_entropy_with_logits(logits_BN, occupied_BN).backward()
        optimizer.step()
        optimizer.zero_grad()

    return step


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    ways = {
        (name, precision): training_step(overrides, precision)
        for name, overrides in MODELS.items()
        for precision in (torch.float32, torch.bfloat16)
    }
    seconds: dict[tuple[str, torch.dtype], list[float]] = {way: [] for way in ways}
    for _ in range(options.steps + 3):
        for way, step in ways.items():
            start = time.perf_counter()
            step()
            seconds[way].append(time.perf_counter() - start)
    print(
        f"{'model':<20} {'fp32 ms':>8} {'bf16 ms':>8}   ({options.threads} thread(s), median of {options.steps})"
    )
    for name in MODELS:
        fp32, bf16 = (
            1000 * float(np.median(seconds[name, kind][3:])) for kind in (torch.float32, torch.bfloat16)
        )
        print(f"{name:<20} {fp32:>8.0f} {bf16:>8.0f}")


if __name__ == "__main__":
    main()
