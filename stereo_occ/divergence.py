"""Trainings whose numbers have become infinite or NaN stop, and keep no such state."""

from collections.abc import Mapping
from typing import Any, NoReturn

import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Callback
from lightning.pytorch.plugins.precision import MixedPrecision
from torch import Tensor

from stereo_occ.errors import UserError


class StopIfDiverged(Callback):
    """Looks at the loss every ``interval`` steps and before a validation, at the weights before they are saved.

    With float16 the loss may be infinite until its scale is found, so there the weights alone are looked at.
    """

    def __init__(self, interval: int, validation_interval: int) -> None:
        self.intervals = interval, validation_interval

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Tensor | Mapping[str, Any] | None,
        batch: Any,
        batch_idx: int,
    ) -> None:
        """Look at the loss.

        Raises:
            UserError: it is not finite.
        """
        if all(trainer.global_step % interval for interval in self.intervals) or _scales(trainer):
            return
        loss = outputs["loss"] if isinstance(outputs, Mapping) else outputs
        if loss is not None and not torch.isfinite(loss).all():
            _stop(trainer, f"the loss is {float(loss)}")

    def on_save_checkpoint(
        self, trainer: Trainer, pl_module: LightningModule, checkpoint: dict[str, Any]
    ) -> None:
        """Look at the weights.

        Raises:
            UserError: one is not finite.
        """
        for name, parameter in pl_module.named_parameters():
            if not torch.isfinite(parameter).all():
                _stop(trainer, f"{name} is not finite")


def _scales(trainer: Trainer) -> bool:
    plugin = trainer.precision_plugin
    return isinstance(plugin, MixedPrecision) and plugin.scaler is not None


def _stop(trainer: Trainer, what: str) -> NoReturn:
    raise UserError(
        f"{what} after step {trainer.global_step}: the training has diverged; lower optimizer.lr, set "
        "trainer.gradient_clip=1 or, where half precision is at fault, trainer.precision=32-true; "
        "the checkpoints are of before"
    )
