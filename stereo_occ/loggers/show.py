"""What a run shows beyond its losses: pairs, meshes, curves, hyper-parameters."""

from collections.abc import Sequence
from typing import Any

import lightning
import torch
from lightning.pytorch import LightningModule
from lightning.pytorch.callbacks import Callback
from numpy.typing import NDArray
from torch import Tensor
from trimesh import Trimesh

from stereo_occ.data.batch import Batch
from stereo_occ.data.examples import examples
from stereo_occ.loggers.board import Board
from stereo_occ.loggers.config import LoggerConfig
from stereo_occ.loggers.curves import curves_picture
from stereo_occ.reconstruction import reconstruct
from stereo_occ.task import OccupancyTask

CURVE_POINTS = 512  # per view
SETTINGS = (
    "model",
    "control",
    "augmentation",
    "auxiliary",
    "averaging",
    "optimizer",
    "scheduler",
    "queries",
    "rig",
    "placement",
    "seed",
    "steps",
    "batch_size",
    "points",
)


class Show(Callback):
    """Once: settings, input pairs, true meshes. Each validation: predicted meshes, precision-recall and reliability.

    Args:
        settings: the whole configuration as plain values.
    """

    def __init__(self, config: LoggerConfig, boards: Sequence[Board], settings: dict[str, Any]) -> None:
        self.config = config
        self.boards = boards
        self.shown_on = [board for board in boards if board.shows]
        self.settings = {group: settings[group] for group in SETTINGS}
        self._answers: list[tuple[Tensor, Tensor]] = []
        self._truth_shown = False

    def on_fit_start(self, trainer: lightning.Trainer, pl_module: LightningModule) -> None:
        for board in self.boards:
            board.log_hyperparams(self.settings)

    def on_validation_batch_end(
        self,
        trainer: lightning.Trainer,
        pl_module: LightningModule,
        outputs: Any,
        batch: Batch,
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        occupied_BN = batch.queries["bbox"].occupied_BN[:, :CURVE_POINTS]
        self._answers.append((outputs["bbox"][:, :CURVE_POINTS].flatten(), occupied_BN.flatten()))

    def on_validation_end(self, trainer: lightning.Trainer, pl_module: LightningModule) -> None:
        assert isinstance(pl_module, OccupancyTask)
        logits_N, occupied_N = (torch.cat(parts).cpu() for parts in zip(*self._answers, strict=True))
        self._answers.clear()
        if not self.shown_on:
            return
        step, threshold = trainer.global_step, pl_module.scores.mean_threshold(pl_module.decision)
        for board in self.shown_on:
            board.answers("val/precision_recall", logits_N.sigmoid(), occupied_N, step)
        self._picture("val/curves", curves_picture(logits_N, occupied_N, threshold), step)
        data = trainer.datamodule  # type: ignore[attr-defined]
        for example in examples(data.evaluation_dataset("val"), self.config.examples):
            name = f"example/{example.id.object_id}"
            views = example.batch.to(pl_module.device).views
            predicted = reconstruct(pl_module.model, views, pl_module.decision, self.config.mesh_resolution)
            self._mesh(f"{name}/predicted", predicted, step)
            if not self._truth_shown:
                pair_CHW = torch.cat([views.left_BCHW[0], views.right_BCHW[0]], dim=-1)
                pair_HW3 = (pair_CHW.permute(1, 2, 0) * 255).round().byte().cpu().numpy()
                self._picture(f"{name}/left_right", pair_HW3, step)
                self._mesh(f"{name}/true", example.true, step)
        self._truth_shown = True

    def _picture(self, name: str, image_HW3: NDArray[Any], step: int) -> None:
        for board in self.shown_on:
            board.picture(name, image_HW3, step)

    def _mesh(self, name: str, mesh: Trimesh, step: int) -> None:
        for board in self.shown_on if len(mesh.faces) else ():
            board.mesh(name, mesh, step)
