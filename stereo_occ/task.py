"""The Lightning module around any occupancy model."""

from typing import Any

import lightning
import torch
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from stereo_occ.checkpoint import KEY, VERSION
from stereo_occ.config import TrainConfig
from stereo_occ.data.batch import Batch
from stereo_occ.metrics.scores import Scores
from stereo_occ.models.base import OccupancyModel
from stereo_occ.optimization import build_optimizer, build_schedule


class OccupancyTask(lightning.LightningModule):
    """Binary cross entropy on sampled points; IoU on validation and test objects.

    Args:
        config: of the training.
        record: the whole configuration as plain values; it goes into every checkpoint.

    Attributes:
        threshold: decision threshold on the probability, chosen at each validation, kept in checkpoints.
        scores: the views seen by the current or last evaluation.
    """

    threshold: Tensor

    def __init__(self, model: OccupancyModel, config: TrainConfig, record: dict[str, Any]) -> None:
        super().__init__()
        self.model = model
        self.config = config
        self.record = record
        self.scores = Scores()
        self.register_buffer("threshold", torch.tensor(0.5))

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        queries = batch.queries["train"]
        code = self.model.encode(batch.views)
        logits_BN = self.model.decode(code, queries.points_BN3)
        loss = binary_cross_entropy_with_logits(logits_BN, queries.occupied_BN)
        loss = loss + self.model.guidance(code, queries.points_BN3, queries.occupied_BN)
        self.log("train/loss", loss, prog_bar=True, batch_size=len(batch))
        return loss

    def _evaluation_step(self, batch: Batch, stage: str) -> dict[str, Tensor]:
        code = self.model.encode(batch.views)
        logits = {
            name: self.model.decode_all(code, q.points_BN3).float() for name, q in batch.queries.items()
        }
        self.scores.update(batch, logits)
        loss = binary_cross_entropy_with_logits(logits["bbox"], batch.queries["bbox"].occupied_BN)
        self.log(f"{stage}/loss", loss, batch_size=len(batch))
        return logits

    def _log_scores(self, stage: str) -> None:
        values = self.scores.summary(float(self.threshold)) | {"iou_at_0.5": self.scores.summary(0.5)["iou"]}
        self.log_dict({f"{stage}/{name}": value for name, value in values.items()})
        self.log(f"{stage}/threshold", self.threshold)

    def on_validation_epoch_start(self) -> None:
        self.scores = Scores()

    def validation_step(self, batch: Batch, batch_idx: int) -> dict[str, Tensor]:
        return self._evaluation_step(batch, "val")

    def on_validation_epoch_end(self) -> None:
        self.threshold.fill_(self.scores.best_threshold())
        self._log_scores("val")

    def on_test_epoch_start(self) -> None:
        self.scores = Scores()

    def test_step(self, batch: Batch, batch_idx: int) -> dict[str, Tensor]:
        return self._evaluation_step(batch, "test")

    def on_test_epoch_end(self) -> None:
        self._log_scores("test")

    def configure_optimizers(self) -> OptimizerLRScheduler:
        optimizer = build_optimizer(self.config.optimizer, self.model)
        schedule = build_schedule(self.config.scheduler, optimizer, self.config.steps)
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        checkpoint[KEY] = {"version": VERSION, "config": self.record}
