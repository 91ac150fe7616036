"""What a run shows in TensorBoard beyond its losses: pairs, meshes, precision-recall, hyper-parameters."""

from collections.abc import Mapping
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch import LightningModule
from lightning.pytorch.callbacks import Callback
from lightning.pytorch.loggers import TensorBoardLogger
from torch import Tensor
from torch.utils.tensorboard import SummaryWriter
from torch.utils.tensorboard.summary import hparams
from trimesh import Trimesh

from stereo_occ.config import LoggerConfig
from stereo_occ.data.batch import Batch
from stereo_occ.data.examples import examples
from stereo_occ.reconstruction import reconstruct
from stereo_occ.task import OccupancyTask

CURVE_POINTS = 512  # per view
HPARAM_GROUPS = (
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
HPARAM_METRICS = ("val/iou", "val/iou_bbox", "val/iou_unrotated", "val/loss")


class StepLogger(TensorBoardLogger):
    """TensorBoard with the steps taken on the horizontal axis; Lightning counts the first one as 0."""

    def log_metrics(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        scalars = {name: value for name, value in metrics.items() if name != "epoch"}
        super().log_metrics(scalars, None if step is None else step + 1)


class ShowInTensorBoard(Callback):
    """Each validation: meshes and the precision-recall curve. Once: input pairs, true meshes, HParams."""

    def __init__(self, config: LoggerConfig, hyper_parameters: dict[str, Any]) -> None:
        self.config = config
        self.hyper_parameters = hyper_parameters
        self._curve: list[tuple[Tensor, Tensor]] = []
        self._truth_shown = False

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
        self._curve.append((outputs["bbox"][:, :CURVE_POINTS].sigmoid().flatten(), occupied_BN.flatten()))

    def on_validation_end(self, trainer: lightning.Trainer, pl_module: LightningModule) -> None:
        assert isinstance(pl_module, OccupancyTask)
        writer, step = _writer(trainer), trainer.global_step
        probabilities, occupied = (torch.cat(parts) for parts in zip(*self._curve, strict=True))
        self._curve.clear()
        writer.add_pr_curve("val/precision_recall", occupied, probabilities, step)
        data = trainer.datamodule  # type: ignore[attr-defined]
        for example in examples(data.evaluation_dataset("val"), self.config.examples):
            name = f"example/{example.id.object_id}"
            views = example.batch.to(pl_module.device).views
            threshold = float(pl_module.threshold)
            predicted = reconstruct(pl_module.model, views, threshold, self.config.mesh_resolution)
            _add_mesh(writer, f"{name}/predicted", predicted, step)
            if not self._truth_shown:
                writer.add_image(
                    f"{name}/left_right", torch.cat([views.left_BCHW[0], views.right_BCHW[0]], dim=-1), step
                )
                _add_mesh(writer, f"{name}/true", example.true, step)
        self._truth_shown = True

    def on_fit_end(self, trainer: lightning.Trainer, pl_module: LightningModule) -> None:
        # The table reads the values from the curves; torch's add_hparams would write them again, as step 0.
        metrics = dict.fromkeys(HPARAM_METRICS, 0.0)
        chosen = {group: self.hyper_parameters[group] for group in HPARAM_GROUPS}
        for summary in hparams(flatten(chosen), metrics):  # type: ignore[no-untyped-call]
            _writer(trainer)._get_file_writer().add_summary(summary)  # type: ignore[no-untyped-call]


def flatten(config: dict[str, Any], prefix: str = "") -> dict[str, str | int | float | bool]:
    """Nested dictionaries to dotted keys with scalar values."""
    flat: dict[str, str | int | float | bool] = {}
    for key, value in config.items():
        if isinstance(value, dict):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value if isinstance(value, (int, float, bool)) else str(value)
    return flat


def _writer(trainer: lightning.Trainer) -> SummaryWriter:
    assert trainer.logger is not None
    writer = trainer.logger.experiment  # type: ignore[attr-defined]
    assert isinstance(writer, SummaryWriter)
    return writer


def _add_mesh(writer: SummaryWriter, tag: str, mesh: Trimesh, step: int) -> None:
    """Coloured by the direction of the surface, as normal maps are."""
    if len(mesh.faces):
        colors = (127.5 * (np.asarray(mesh.vertex_normals) + 1)).astype(np.uint8)
        arrays = (mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), colors)
        vertices_1V3, faces_1F3, colors_1V3 = (torch.from_numpy(array)[None] for array in arrays)
        writer.add_mesh(tag, vertices_1V3, colors=colors_1V3, faces=faces_1F3, global_step=step)
