"""Runs that are stopped at any moment and go on as if they had not been."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

import torch
from lightning.fabric.plugins import TorchCheckpointIO
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Checkpoint, ModelCheckpoint

from stereo_occ.checkpoint import KEY, config_of, plain, read_checkpoint
from stereo_occ.errors import UserError
from stereo_occ.writing import whole_file

#: What as a whole must not change between the parts of a run. Hardware, logging and the length of the run may.
FIXED = (
    "rig", "placement", "lights", "material", "texture", "background", "sensor", "categories",
    "model", "init", "control", "augmentation", "auxiliary", "averaging", "queries", "optimizer",
    "seed", "points", "batch_size",
)  # fmt: skip


class SaveLatest(Checkpoint):
    """Keeps the latest state in ``path``: every ``interval`` steps, at the end, and when SIGTERM asks to stop.

    Where a validation is due at the same step it is saved after it, so that a resumed run neither skips nor repeats
    it, and knows its result.
    """

    def __init__(self, path: Path, interval: int, validation_interval: int) -> None:
        self.path = path
        self.interval = interval
        self.validation_interval = validation_interval
        self.step = 0  # that a stopped run goes on from

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        self.step = trainer.global_step

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        if trainer.global_step % self.validation_interval:
            self._save(trainer)

    def on_validation_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        self._save(trainer)

    def _save(self, trainer: Trainer) -> None:
        due = trainer.global_step % self.interval == 0 or trainer.global_step == trainer.max_steps
        if due or trainer.received_sigterm:
            trainer.save_checkpoint(self.path)
            self.step = trainer.global_step


class SaveBest(ModelCheckpoint):
    """Keeps the state of the best validation as ``best.ckpt`` in ``folder``, also where that has been moved."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            folder,
            filename="best",
            monitor="val/iou",
            mode="max",
            auto_insert_metric_name=False,
            enable_version_counter=False,
        )

    @property
    def state_key(self) -> str:
        """Lightning's own class's, so that runs go on whose checkpoints are from before this class."""
        return super().state_key.replace(type(self).__qualname__, ModelCheckpoint.__qualname__, 1)

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Know of the best state in this folder; Lightning forgets it where the folder had another name."""
        best = Path(str(self.dirpath)) / Path(state_dict["best_model_path"]).name
        if best.is_file():
            path, score = str(best), state_dict["best_model_score"]
            state_dict = state_dict | {
                "dirpath": self.dirpath,
                "best_model_path": path,
                "kth_best_model_path": path,
                "best_k_models": {path: score},
            }
        super().load_state_dict(state_dict)


class AtomicCheckpoints(TorchCheckpointIO):
    """Writes a checkpoint beside its place and moves it there when it is whole, within one file system."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: Any, storage_options: Any = None) -> None:
        """Save ``checkpoint`` so that ``path`` holds the old or the new one, whatever interrupts the saving.

        Raises:
            UserError: the disk is full or the folder cannot be written.
        """
        target, refusals = Path(path), list[OSError]()
        try:
            with whole_file(target) as file:
                torch.save(checkpoint, cast(BinaryIO, _Noting(file, refusals)))
        except (
            OSError,
            RuntimeError,
        ) as error:  # torch raises its own, which does not say what the system said
            reason = next((refusal.strerror for refusal in refusals), None) or " ".join(str(error).split())
            raise UserError(
                f"{target}: cannot write the checkpoint ({reason}); free some disk space"
            ) from error


class _Noting:
    """A file that notes why it could not be written."""

    def __init__(self, file: BinaryIO, refusals: list[OSError]) -> None:
        self.file, self.refusals = file, refusals

    def write(self, data: bytes) -> int:
        try:
            return self.file.write(data)
        except OSError as error:
            self.refusals.append(error)
            raise

    def flush(self) -> None:
        self.file.flush()


def _fixed(config: Mapping[str, Any]) -> dict[str, Any]:
    """What must not change, by its name; a schedule's warm-up follows the run's length, which may.

    Of files it is what they hold, which is compared for itself, and not where they are or how long they may be read.
    """
    return {
        "data": _without(config["data"], "root", "time_limit", "memory_limit"),
        **{name: config[name] for name in FIXED},
        "scheduler": _without(config["scheduler"], "warmup"),
        "validation.decision": config["validation"]["decision"],
    }


def _without(settings: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in settings.items() if key not in keys}


def step_to_resume(checkpoint: Path, config: dict[str, Any], objects: Mapping[str, list[str]]) -> int:
    """The step that ``checkpoint`` was saved at, if it is of the run that is to go on.

    Args:
        config: of the run, as plain values.
        objects: of the run, see :func:`~stereo_occ.data.objects.training_objects`.

    Raises:
        UserError: it is damaged, holds weights alone, or is of a run with other settings or objects.
    """
    try:
        saved = read_checkpoint(checkpoint)
    except UserError as error:
        raise UserError(f"{error}; or copy best.ckpt over it, or say resume=never to start over") from error
    former = plain(config_of(saved, checkpoint))
    before, now = _fixed(former), _fixed(config)
    changed = [name for name in now if before[name] != now[name]]
    if changed:
        raise UserError(
            f"{checkpoint.parent}: holds a run with another {', '.join(changed)}; "
            f"choose another hydra.run.dir, or resume=never to start over"
        )
    if saved[KEY].get("objects", objects) != objects:
        raise UserError(
            f"{checkpoint.parent}: holds a run with other training or validation objects; bring the files in "
            f"{config['data'].get('root')} back to what they were, or choose another hydra.run.dir, or resume=never "
            f"to start over"
        )
    if "optimizer_states" not in saved:
        raise UserError(
            f"{checkpoint}: holds weights alone and no state to go on from; say resume=never init=FILE to begin with "
            f"them"
        )
    step = int(saved["global_step"])
    if step > config["steps"]:
        raise UserError(
            f"steps={config['steps']}: the run in {checkpoint.parent} has {step} already; ask for as many or more, or "
            f"choose another hydra.run.dir, or resume=never to start over"
        )
    return step
