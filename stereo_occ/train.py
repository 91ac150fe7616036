"""``python -m stereo_occ.train``: render what is missing, train, validate, write the run folder."""

import logging
import sys
from collections.abc import Sequence
from pathlib import Path

import lightning
import torch
from hydra.core.hydra_config import HydraConfig
from lightning.pytorch.callbacks import Callback, LearningRateMonitor, ModelCheckpoint, TQDMProgressBar
from lightning.pytorch.utilities.exceptions import SIGTERMException
from omegaconf import DictConfig, OmegaConf

from stereo_occ.auxiliary import AuxiliaryConfig
from stereo_occ.checkpoint import build_task, plain
from stereo_occ.checks.training import check_training
from stereo_occ.cli import entry_point
from stereo_occ.config import Resume, TrainConfig
from stereo_occ.data.datamodule import PairsDataModule
from stereo_occ.data.objects import Objects, list_objects, training_objects
from stereo_occ.divergence import StopIfDiverged
from stereo_occ.errors import UserError
from stereo_occ.group import is_first, run_in_processes, started_elsewhere
from stereo_occ.loggers.board import Board
from stereo_occ.loggers.build import build_boards
from stereo_occ.loggers.show import Show
from stereo_occ.memory import keep_freed_memory
from stereo_occ.metrics_file import WriteMetrics, best_iou
from stereo_occ.precision import chosen_precision
from stereo_occ.quiet import quiet_libraries
from stereo_occ.resume import AtomicCheckpoints, SaveBest, SaveLatest, step_to_resume
from stereo_occ.run_folder import OVERRIDES
from stereo_occ.trained import begin_with
from stereo_occ.writing import write_whole

logger = logging.getLogger(__name__)

METRICS_FILE = "metrics.json"

#: How torch begins what it raises where batch normalisation has one value alone to normalise.
ONE_VALUE = "Expected more than 1 value per channel when training"


def train(cfg: DictConfig, folder: Path, overrides: Sequence[str] | None = None) -> lightning.Trainer:
    """Train ``cfg`` in ``folder``, from its latest checkpoint if ``resume=auto`` and there is one.

    Args:
        overrides: of the command line, noted in the folder.
    """
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, TrainConfig)
    quiet_libraries()
    keep_freed_memory()
    if typed.trainer.threads:
        torch.set_num_threads(typed.trainer.threads)
    latest = folder / "last.ckpt"
    resume = typed.resume is Resume.auto and latest.exists()
    objects = list_objects(typed, typed.progress and is_first())
    identities = training_objects(objects.sources, typed)
    if objects.skipped and is_first():
        logger.warning(
            "%d mesh files or folders are left out; python -m stereo_occ.inspect with the same data says why",
            len(objects.skipped),
        )
    step = step_to_resume(latest, plain(cfg), identities) if resume else 0
    lightning.seed_everything(typed.seed, verbose=False)
    task = build_task(cfg, load_weights=not resume and typed.init is None, objects=identities)
    if typed.init is not None and not resume:
        begin_with(typed.init, task.model, plain(cfg)["model"])
    data = build_data(typed, objects)
    boards: list[Board] = []
    if is_first():
        data.prepare_data()
        write_whole(folder / "config.yaml", OmegaConf.to_yaml(cfg, resolve=True).encode())
        if overrides is not None:
            write_whole(folder / OVERRIDES, OmegaConf.to_yaml(list(overrides)).encode())
        boards = build_boards(typed.logger, folder, step)
    kept = SaveLatest(latest, typed.validation.checkpoint_interval, typed.validation.interval)
    callbacks = build_callbacks(cfg, typed, folder, boards, kept)
    trainer = build_trainer(typed, folder, callbacks, boards)
    try:
        trainer.fit(task, data, ckpt_path=latest if resume else None, weights_only=True)
    except (
        SystemExit
    ) as stop:  # how Lightning ends after Ctrl-C (code 1) or SIGTERM (code 0, as if it were done)
        command = "the same command" + (" without resume=never" if typed.resume is Resume.never else "")
        sys.stderr.write(
            f"stereo_occ: stopped after step {trainer.global_step} of {typed.steps}; "
            f"{command} with hydra.run.dir={folder} goes on from step {kept.step}\n"
        )
        raise SystemExit(143 if isinstance(stop, SIGTERMException) else 130) from stop
    except ValueError as error:
        if not str(error).startswith(ONE_VALUE):
            raise
        raise UserError(
            f"batch_size={typed.batch_size}: of images of {typed.data.image_side} pixels this model has a last map of "
            f"one cell, too few for batch normalisation; take more pairs for each process, or larger images"
        ) from error
    return trainer


def train_together(cfg: DictConfig, folder: Path, overrides: Sequence[str] | None = None) -> None:
    """:func:`train` in ``trainer.devices`` new processes of this machine."""
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, TrainConfig)
    # Rendered before they start: a group waits half an hour for its first process, no longer.
    build_data(typed).prepare_data()
    run_in_processes(typed.trainer.devices, train, cfg, folder, overrides)


def build_data(typed: TrainConfig, objects: Objects | None = None) -> PairsDataModule:
    """The data of a training configuration, whose objects may be listed already."""
    data = PairsDataModule(
        typed,
        control=typed.control,
        evaluation_views=typed.validation.views,
        evaluation_points=typed.validation.points,
        evaluation_batch_size=typed.batch_size,
        workers=typed.trainer.workers,
        progress=typed.progress,
        objects=objects,
    )
    data.for_training(
        typed.queries,
        typed.points,
        typed.batch_size,
        typed.steps,
        typed.seed,
        typed.augmentation,
        truth=typed.auxiliary != AuxiliaryConfig(),
    )
    return data


def build_callbacks(
    cfg: DictConfig, typed: TrainConfig, folder: Path, boards: Sequence[Board], kept: SaveLatest
) -> list[Callback]:
    """Checkpoints (the best, and ``kept``), metrics file, pictures, progress bar."""
    validation = typed.validation
    states: list[Callback] = [SaveBest(folder)]
    if validation.keep_all:
        states.append(
            ModelCheckpoint(
                folder,
                filename="step_{step:06d}",
                monitor="val/iou",
                save_top_k=-1,
                save_weights_only=True,
                auto_insert_metric_name=False,
                enable_version_counter=False,
            )
        )
    callbacks: list[Callback] = [
        StopIfDiverged(typed.logger.interval, validation.interval),
        *states,
        kept,
        WriteMetrics(folder / METRICS_FILE),
    ]
    if boards:
        callbacks += [
            Show(typed.logger, boards, plain(cfg)),
            LearningRateMonitor(logging_interval="step"),
        ]
    if typed.progress:
        callbacks.append(TQDMProgressBar(refresh_rate=10))
    return callbacks


def build_trainer(
    typed: TrainConfig, folder: Path, callbacks: list[Callback], boards: Sequence[Board]
) -> lightning.Trainer:
    """A trainer of exactly ``steps`` optimiser steps that validates every ``validation.interval`` of them."""
    return lightning.Trainer(
        accelerator=typed.trainer.accelerator,
        devices=typed.trainer.devices,
        num_nodes=typed.trainer.nodes,
        strategy="ddp" if typed.trainer.processes > 1 else "auto",
        precision=chosen_precision(typed.trainer.precision, typed.trainer.accelerator),  # type: ignore[arg-type]
        max_steps=typed.steps,
        max_epochs=-1,
        val_check_interval=typed.validation.interval,
        check_val_every_n_epoch=None,
        num_sanity_val_steps=0,
        gradient_clip_val=typed.trainer.gradient_clip,
        log_every_n_steps=min(typed.logger.interval, typed.steps),
        logger=list(boards),
        callbacks=callbacks,
        plugins=AtomicCheckpoints(),
        enable_progress_bar=typed.progress,
        enable_model_summary=False,
        use_distributed_sampler=False,
        default_root_dir=folder,
    )


@entry_point("train", check_training)
def main(cfg: DictConfig) -> float | None:
    """Train into Hydra's run folder; the best ``val/iou``, in the first process of a group."""
    folder = Path(HydraConfig.get().runtime.output_dir)
    arguments = cfg, folder, list(HydraConfig.get().overrides.task)
    if cfg.trainer.devices > 1 and not started_elsewhere():
        train_together(*arguments)
    else:
        train(*arguments)
    return best_iou(folder / METRICS_FILE) if is_first() else None


if __name__ == "__main__":
    main()
