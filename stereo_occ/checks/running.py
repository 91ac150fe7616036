"""What trainings and evaluations have in common: a control, and the machine they run on."""

from collections.abc import Iterator

import torch
from omegaconf import DictConfig

from stereo_occ.checks.values import at_least, known
from stereo_occ.cores import beyond_cores
from stereo_occ.data.controls import CONTROLS
from stereo_occ.precision import PRECISIONS, on_gpu

ACCELERATORS = ("cpu", "gpu", "auto")


def control_problems(cfg: DictConfig) -> Iterator[str]:
    """Of the control that pairs are seen under."""
    name, degrees = cfg.control.name, cfg.control.degrees
    yield from known("control.name", name, CONTROLS)
    if name == "calibration_off" and not 0 < degrees <= 180:
        yield f"control.degrees={degrees}: must be above 0 and at most 180"
    elif name != "calibration_off" and degrees:
        yield f"control.degrees={degrees}: control={name} turns no camera; leave it at 0"


def hardware_problems(cfg: DictConfig) -> Iterator[str]:
    """Of processors, processes of loaders and precision."""
    trainer = cfg.trainer
    yield from at_least(0, cfg, "trainer.workers")
    yield from beyond_cores("trainer.workers", trainer.workers)
    if trainer.threads is not None:
        yield from at_least(1, cfg, "trainer.threads")
        yield from beyond_cores("trainer.threads", trainer.threads)
    yield from known("trainer.precision", trainer.precision, PRECISIONS)
    yield from known("trainer.accelerator", trainer.accelerator, ACCELERATORS)
    if trainer.accelerator == "gpu" and not torch.cuda.is_available():
        yield "trainer.accelerator=gpu: PyTorch sees no GPU here; say trainer=cpu"
    elif trainer.precision == "16-mixed" and not on_gpu(trainer.accelerator):
        yield "trainer.precision=16-mixed: processors have no half precision; say auto"
