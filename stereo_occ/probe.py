"""``python -m stereo_occ.probe opengl|render|train``: short measurements of this machine, printed as JSON.

For :mod:`stereo_occ.doctor`, which starts each in a process of its own.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from stereo_occ.errors import UserError

SECONDS = 2.5  # of each measurement


def opengl() -> dict[str, Any]:
    """What OpenGL says of itself."""
    from stereo_occ.render.gl import process_renderer

    process_renderer(8, 8)._platform.make_current()
    from OpenGL import EGL, GL

    return {
        "EGL": f"{EGL.eglQueryString(EGL.eglGetCurrentDisplay(), EGL.EGL_VENDOR).decode()}",
        "OpenGL": ", ".join(GL.glGetString(name).decode() for name in (GL.GL_RENDERER, GL.GL_VERSION)),
    }


def render() -> dict[str, Any]:
    """Seconds of one core for a pair of 64 pixels, and for an object apart from its pairs."""
    os.environ |= {"LP_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    from dataclasses import replace
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from omegaconf import OmegaConf

    from stereo_occ.cli import compose_config
    from stereo_occ.config import RenderConfig
    from stereo_occ.data.objects import list_objects
    from stereo_occ.data.prepare import render_object

    cfg = OmegaConf.to_object(compose_config("render", ["scale=laptop", "categories=mug"]))
    assert isinstance(cfg, RenderConfig)
    source = list_objects(cfg, progress=False).sources[1]

    def seconds(views: int) -> float:
        pairs = replace(cfg, data=replace(cfg.data, views=views))
        with TemporaryDirectory() as folder:
            start = time.process_time()
            render_object(source, Path(folder) / "mug.h5", pairs)
            return time.process_time() - start

    seconds(2)  # starts OpenGL and compiles its shaders
    few = seconds(1)
    many = seconds(100)
    return {"pair": (many - few) / 99, "object": max(0.0, few - (many - few) / 99)}


def train() -> dict[str, Any]:
    """Milliseconds for a step of the paper's network at scale=laptop, in both precisions."""
    import torch
    from omegaconf import OmegaConf

    from stereo_occ.checkpoint import plain
    from stereo_occ.cli import compose_config
    from stereo_occ.config import TrainConfig
    from stereo_occ.data.rigs import build_rig
    from stereo_occ.models.base import StereoViews
    from stereo_occ.models.build import build_model
    from stereo_occ.optimization import build_optimizer

    composed = compose_config("train", ["scale=laptop"])
    cfg = OmegaConf.to_object(composed)
    assert isinstance(cfg, TrainConfig)
    rig = build_rig(cfg.rig, cfg.data.image_side)
    model: Any = build_model(plain(composed.model), rig, load_weights=False)
    optimizer = build_optimizer(cfg.optimizer, model)
    size, side = cfg.batch_size, cfg.data.image_side
    left, right = torch.rand(2, size, 3, side, side)
    K_233, camera_from_rig_244 = (
        torch.stack([torch.tensor(getattr(camera, name)).float() for camera in rig.cameras])
        for name in ("K", "camera_from_rig")
    )
    views = StereoViews(
        left, right, K_233.expand(size, -1, -1, -1), camera_from_rig_244.expand(size, -1, -1, -1)
    )
    points_BN3, occupied_BN = torch.rand(size, cfg.points, 3) - 0.5, torch.rand(size, cfg.points).round()

    def step(precision: str) -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=precision == "bf16-mixed"):
            logits_BN = model(views, points_BN3).float()
        loss = torch.nn.functional.binary_cross_entropy_with_logits(logits_BN, occupied_BN)
        torch.autograd.backward(loss)
        optimizer.step()
        optimizer.zero_grad()

    return {
        "threads": torch.get_num_threads(),
        "gpu": torch.cuda.get_device_name() if torch.cuda.is_available() else "none",
        "ms_per_step": {
            f"trainer.precision={precision}": _median_ms(partial(step, precision))
            for precision in ("32-true", "bf16-mixed")
        },
    }


def _median_ms(function: Callable[[], None]) -> float:
    function()
    times: list[float] = []
    while sum(times) < SECONDS:
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1000 * sorted(times)[len(times) // 2]


if __name__ == "__main__":
    try:
        print(json.dumps({"opengl": opengl, "render": render, "train": train}[sys.argv[1]]()))
    except (UserError, ImportError) as error:
        sys.exit(str(error))
