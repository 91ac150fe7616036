"""The Lightning module around any occupancy model."""

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import lightning
import torch
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from stereo_occ.auxiliary import AuxiliaryConfig, AuxiliaryHeads, auxiliary_losses, outputs_of
from stereo_occ.averaging import WeightAverage
from stereo_occ.checkpoint import KEY, VERSION
from stereo_occ.config import TrainConfig
from stereo_occ.data.batch import Batch
from stereo_occ.decision import Decision
from stereo_occ.group import gathered, share_buffers
from stereo_occ.metrics.scores import Scores
from stereo_occ.models.base import OccupancyModel
from stereo_occ.models.encoders import ImageEncoder
from stereo_occ.optimization import build_optimizer, build_schedule


class OccupancyTask(lightning.LightningModule):
    """Binary cross entropy on sampled points; IoU on validation and test objects.

    Args:
        config: of the training.
        record: the whole configuration as plain values; it goes into every checkpoint.
        objects: identities of the training's objects by subset; they go there too.

    Attributes:
        threshold: of the decision, chosen at each validation, kept in checkpoints.
        scores: the views seen by the current or last evaluation.
        average: of the model's weights, if the training keeps one.
        auxiliary: heads on the encoder, while a training that asks for them lasts.
    """

    threshold: Tensor
    auxiliary: AuxiliaryHeads | None

    def __init__(
        self,
        model: OccupancyModel,
        config: TrainConfig,
        record: dict[str, Any],
        objects: Mapping[str, list[str]] | None = None,
    ) -> None:
        super().__init__()
        self.model = model
        self.config = config
        self.record = record
        self.objects = objects
        self.scores = Scores(rule=config.validation.decision)
        self.register_buffer("threshold", torch.tensor(0.5))
        decay = config.averaging.decay
        self.average = None if decay is None else WeightAverage(model, decay)
        self.auxiliary = None

    def configure_model(self) -> None:
        if self.auxiliary is None and self.config.auxiliary != AuxiliaryConfig():
            self.auxiliary = AuxiliaryHeads(self._encoder.channels)

    @property
    def decision(self) -> Decision:
        """From which probability on a point counts as inside."""
        return Decision(float(self.threshold), self.config.validation.decision)

    @property
    def _encoder(self) -> ImageEncoder:
        encoder = self.model.encoder
        assert isinstance(encoder, ImageEncoder)
        return encoder

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        queries = batch.queries["train"]
        watched: AbstractContextManager[list[Tensor]] = nullcontext([])
        if self.auxiliary is not None:
            watched = outputs_of(self._encoder)
        with watched as features:
            code = self.model.encode(batch.views)
        logits_BN = self.model.decode(code, queries.points_BN3)
        loss = binary_cross_entropy_with_logits(logits_BN, queries.occupied_BN)
        self.log("train/loss", loss, prog_bar=True, batch_size=len(batch))
        loss = loss + self.model.guidance(code, queries.points_BN3, queries.occupied_BN)
        if self.auxiliary is not None:
            losses = auxiliary_losses(self.auxiliary, features[0], batch, self.model.seen_depths(code))
            for name, value in losses.items():
                self.log(f"train/{name}_loss", value, batch_size=len(batch))
                loss = loss + getattr(self.config.auxiliary, name) * value
        return loss

    def on_fit_start(self) -> None:
        if self.average is not None:
            self.average.to(self.device)

    def optimizer_step(self, *args: Any, **kwargs: Any) -> None:
        super().optimizer_step(*args, **kwargs)
        if self.average is not None:
            self.average.update(self.trainer.global_step)

    def on_validation_start(self) -> None:
        if self.average is not None:
            self.average.swap()
        share_buffers(self)

    def on_validation_end(self) -> None:
        if self.average is not None:  # after the callbacks, which draw and save
            self.average.swap()

    def on_validation_epoch_start(self) -> None:
        self.scores = Scores(rule=self.config.validation.decision)

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, Tensor]:
        code = self.model.encode(batch.views)
        logits = {
            name: self.model.decode_all(code, q.points_BN3).float() for name, q in batch.queries.items()
        }
        self.scores.update(batch, logits)
        return logits

    def on_validation_epoch_end(self) -> None:
        self.scores.merge(gathered(self.scores))
        self.threshold.fill_(self.scores.best_threshold())
        self.log("val/loss", self.scores.loss())
        values = self.scores.summary(float(self.threshold)) | {"iou_at_0.5": self.scores.iou_at_half()}
        self.log_dict({f"val/{name}": value for name, value in values.items()})
        self.log("val/threshold", self.threshold)

    def configure_optimizers(self) -> OptimizerLRScheduler:
        fused = self.config.trainer.gradient_clip is None
        optimizer = build_optimizer(self.config.optimizer, self, fused)
        schedule = build_schedule(self.config.scheduler, optimizer, self.config.steps)
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        checkpoint[KEY] = {"version": VERSION, "config": self.record}
        if self.objects is not None:
            checkpoint[KEY]["objects"] = dict(self.objects)
        if self.average is not None:
            average, weights = self.average.state()
            checkpoint["state_dict"] |= {f"model.{name}": tensor for name, tensor in average.items()}
            if "optimizer_states" in checkpoint:  # a state to go on from
                checkpoint[KEY]["training_weights"] = dict(weights)

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        if self.average is not None:
            state, weights = checkpoint["state_dict"], checkpoint[KEY]["training_weights"]
            self.average.load({name: state[f"model.{name}"] for name in weights})
            state |= {f"model.{name}": tensor for name, tensor in weights.items()}
