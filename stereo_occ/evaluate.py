"""``python -m stereo_occ.evaluate``: test metrics, one row per object, example meshes and pictures."""

import csv
import logging
from pathlib import Path
from typing import Any

import lightning
import torch
from hydra.core.hydra_config import HydraConfig
from lightning.pytorch.callbacks import TQDMProgressBar
from omegaconf import DictConfig, OmegaConf
from PIL import Image

from stereo_occ.checkpoint import KEY, build_task, read_checkpoint
from stereo_occ.checks import check_evaluation, check_pairs
from stereo_occ.cli import entry_point
from stereo_occ.config import EvaluateConfig, TrainConfig, training_config
from stereo_occ.data.datamodule import PairsDataModule
from stereo_occ.data.examples import examples
from stereo_occ.data.rigs import build_rig
from stereo_occ.errors import UserError
from stereo_occ.metrics_file import environment, write_json
from stereo_occ.pictures import comparison
from stereo_occ.quiet import quiet_libraries
from stereo_occ.reconstruction import reconstruct
from stereo_occ.task import OccupancyTask

logger = logging.getLogger(__name__)

GROUPS = ("data", "rig", "placement", "lights", "material", "texture", "background", "sensor", "categories")


def evaluate(cfg: DictConfig, folder: Path) -> dict[str, float]:
    """Evaluate ``cfg.checkpoint`` and write ``metrics.json``, ``per_object.csv``, ``meshes/`` and ``pictures/``.

    Returns:
        The metrics, with the keys of ``metrics.json``'s ``metrics``.
    """
    quiet_libraries()
    settings = own_settings(cfg)
    if settings.trainer.threads:
        torch.set_num_threads(settings.trainer.threads)
    checkpoint = read_checkpoint(Path(settings.checkpoint))
    trained = training_config(checkpoint[KEY]["config"])
    if settings.control is not None:
        trained.control = settings.control
    task = build_task(trained, load_weights=False)
    load_weights(task, checkpoint["state_dict"], settings.checkpoint)
    if settings.subset == "auto":
        settings.subset = "all" if _other_meshes(cfg, trained) else "test"
    data = build_data(cfg, settings, trained)
    folder.mkdir(parents=True, exist_ok=True)
    trainer = lightning.Trainer(
        accelerator=settings.trainer.accelerator,
        devices=settings.trainer.devices,
        precision=settings.trainer.precision,  # type: ignore[arg-type]
        logger=False,
        enable_checkpointing=False,
        callbacks=[TQDMProgressBar()] if settings.progress else [],
        enable_progress_bar=settings.progress,
        enable_model_summary=False,
        default_root_dir=folder,
    )
    trainer.test(task, data.evaluation_loader(settings.subset), verbose=False)
    metrics = {name: float(value) for name, value in trainer.callback_metrics.items()}
    write_results(folder, settings, checkpoint["global_step"], task, data, metrics)
    write_examples(folder, settings, task, data)
    return metrics


def own_settings(cfg: DictConfig) -> EvaluateConfig:
    """The settings without the groups that complete the checkpoint's: these may refer to its values."""
    own = cfg.copy()
    for group in GROUPS:
        own[group] = None
    settings = OmegaConf.to_object(own)
    assert isinstance(settings, EvaluateConfig)
    return settings


def _other_meshes(cfg: DictConfig, trained: DictConfig) -> bool:
    """Whether the objects asked for are meshes that the checkpoint cannot have been trained on."""
    asked, own = (OmegaConf.select(config, "data.root") for config in (cfg, trained))
    return asked is not None and (own is None or Path(asked).resolve() != Path(own).resolve())


def load_weights(task: OccupancyTask, state_dict: dict[str, Any], path: str) -> None:
    """Load the weights of a checkpoint."""
    try:
        task.load_state_dict(state_dict)
    except RuntimeError as error:
        raise UserError(
            f"checkpoint={path}: its weights do not fit its configuration; it was written by another version"
        ) from error


def build_data(cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig) -> PairsDataModule:
    """The checkpoint's own data, with the groups replaced that the command line gives.

    Raises:
        UserError: with all problems of the combination.
    """
    pairs = trained.copy()
    for group in GROUPS:
        if cfg[group] is not None:
            pairs[group] = cfg[group]
    if cfg.data is not None:
        if OmegaConf.is_interpolation(cfg.data, "views"):
            pairs.data.views = settings.views  # no more than are looked at
        if OmegaConf.is_interpolation(cfg.data, "image_side"):
            pairs.data.image_side = trained.data.image_side
    pairs.paths, pairs.workers = cfg.paths, cfg.workers
    problems = check_pairs(pairs)
    if problems:
        raise UserError("; ".join(problems))
    typed = OmegaConf.to_object(pairs)
    assert isinstance(typed, TrainConfig)
    return PairsDataModule(
        typed,
        evaluation_views=settings.views,
        evaluation_points=settings.points,
        evaluation_batch_size=settings.batch_size,
        workers=settings.trainer.workers,
        progress=settings.progress,
        only=settings.subset,
    )


def write_results(
    folder: Path,
    settings: EvaluateConfig,
    step: int,
    task: OccupancyTask,
    data: PairsDataModule,
    metrics: dict[str, float],
) -> None:
    """``metrics.json``, ``per_object.csv`` and, where files were left out, ``skipped.csv``."""
    threshold = float(task.threshold)
    rows = task.scores.rows(threshold)
    assert data.prepared is not None
    skipped = [vars(file) for file in data.prepared.skipped]
    write_json(
        folder / "metrics.json",
        environment()
        | {
            "checkpoint": settings.checkpoint,
            "step": step,
            "parameters": sum(p.numel() for p in task.model.parameters()),
            "subset": settings.subset,
            "data": str(data.prepared.folder),
            "objects": len(rows),
            "views": settings.views,
            "points": settings.points,
            "threshold": threshold,
            "control": vars(task.config.control),
            "skipped": len(skipped),
            "metrics": metrics,
        },
    )
    write_csv(folder / "per_object.csv", rows)
    if skipped:
        write_csv(folder / "skipped.csv", skipped)


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Rows with the same keys as a CSV file."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def write_examples(
    folder: Path, settings: EvaluateConfig, task: OccupancyTask, data: PairsDataModule
) -> None:
    """Example meshes as GLB and pictures as PNG, left | right | predicted | true."""
    rig = build_rig(data.pairs.rig, data.pairs.data.image_side)
    for example in examples(data.evaluation_dataset(settings.subset), settings.examples):
        views = task.seen(example.batch).views
        predicted = reconstruct(task.model, views, float(task.threshold), settings.mesh_resolution)
        name = f"{example.id.category}/{example.id.object_id}_view{example.id.view}"
        for kind, mesh in (("predicted", predicted), ("true", example.true)):
            if len(mesh.faces):
                mesh.export(_inside(folder / "meshes", f"{name}_{kind}.glb"))
        strip = comparison(views.left_BCHW[0], views.right_BCHW[0], predicted, example.true, rig)
        Image.fromarray(strip).save(_inside(folder / "pictures", f"{name}.png"))


def _inside(folder: Path, name: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


@entry_point("evaluate", check_evaluation)
def main(cfg: DictConfig) -> None:
    """Evaluate into Hydra's run folder and print where to look."""
    folder = Path(HydraConfig.get().runtime.output_dir)
    metrics = evaluate(cfg, folder)
    for name in ("iou", "iou_bbox", "iou_unrotated"):
        logger.info("test/%s %.4f", name, metrics[f"test/{name}"])
    logger.info("results, meshes and pictures are in %s", folder)


if __name__ == "__main__":
    main()
