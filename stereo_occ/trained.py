"""A trained model with what it needs to know of its training, ready to answer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from stereo_occ.checkpoint import config_of, plain, read_checkpoint
from stereo_occ.config import TrainConfig
from stereo_occ.data.augmentation import FLIP_3, mirrored_views
from stereo_occ.data.rigs import build_rig
from stereo_occ.decision import Decision
from stereo_occ.errors import UserError
from stereo_occ.flat import flat
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.build import build_model
from stereo_occ.packaged import is_there, shipped
from stereo_occ.reconstruction import Occupancy, occupancy_of

#: What a stereo pair (``B = 1``) makes of a model.
Predict = Callable[[StereoViews], Occupancy]


def with_mirror_image(predict: Predict) -> Predict:
    """Test-time augmentation: the mean of the logits for a pair and for its mirror image.

    A network takes the two for different pairs, so the errors of its two answers are partly different ones.
    """

    def predict_both(views: StereoViews) -> Occupancy:
        own, other = predict(views), predict(mirrored_views(views))
        flip_3 = np.array(FLIP_3, np.float32)
        return lambda points_N3: np.asarray((own(points_N3) + other(points_N3 * flip_3)) / 2, np.float32)

    return predict_both


@dataclass(frozen=True, eq=False)
class TrainedModel:
    """A model in eval mode.

    Attributes:
        config: of the training.
        decision: from which probability on a point counts as inside.
        step: of the training.
        name: as it was asked for.
    """

    model: OccupancyModel
    config: TrainConfig
    decision: Decision
    step: int
    name: str

    def predict(self, views: StereoViews) -> Occupancy:
        """See :data:`Predict`."""
        return occupancy_of(self.model, views)


def load_trained(name: str) -> TrainedModel:
    """The model of a checkpoint of a run, of exported weights, or of shipped ones by their name.

    Raises:
        UserError: there is no such file, or it is none of these.
    """
    return trained_model(read_named(name), name)


def read_named(name: str) -> dict[str, Any]:
    """What :func:`load_trained` makes the model of; see :func:`~stereo_occ.checkpoint.read_checkpoint`.

    Raises:
        UserError: there is no such file, or it is no checkpoint.
    """
    if not is_there(name):
        raise UserError(
            f"checkpoint={name}: no such file, nor the name of shipped weights "
            f"({', '.join(shipped()) or 'there are none'}); give the best.ckpt of a training run"
        )
    return read_checkpoint(Path(name))


def trained_model(checkpoint: Mapping[str, Any], name: str) -> TrainedModel:
    """The model of a checkpoint that was read, without the heads that only its training had.

    Args:
        name: of the checkpoint.

    Raises:
        UserError: its weights are not those of its configuration, or not numbers.
    """
    cfg = config_of(checkpoint, name)
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, TrainConfig)
    model = build_model(plain(cfg.model), build_rig(typed.rig, typed.data.image_side), load_weights=False)
    state = {
        key: value for key, value in checkpoint["state_dict"].items() if not key.startswith("auxiliary.")
    }
    try:
        threshold = float(state.pop("threshold"))
        model.load_state_dict({key.removeprefix("model."): value for key, value in state.items()})
        step = int(checkpoint["global_step"] or 0)
    except (RuntimeError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise UserError(
            f"checkpoint={name}: its weights do not fit its configuration; it was written by another version"
        ) from error
    numbers = [tensor for tensor in model.state_dict().values() if tensor.is_floating_point()]
    if not (0 < threshold < 1 and all(bool(tensor.isfinite().all()) for tensor in numbers)):
        raise UserError(
            f"checkpoint={name}: holds NaN or infinite numbers, so its training has diverged; use one of before"
        )
    return TrainedModel(model.eval(), typed, Decision(threshold, typed.validation.decision), step, name)


def begin_with(name: str, model: OccupancyModel, config: Mapping[str, Any]) -> None:
    """Give a fresh model the weights of a trained one.

    Args:
        name: as for :func:`load_trained`.
        config: of the fresh model.

    Raises:
        UserError: they cannot be read, or are of another model.
    """
    try:
        trained = load_trained(name)
    except UserError as error:
        raise UserError(f"init: {error}") from error
    theirs, ours = flat(trained.config.model, "model."), flat(config, "model.")
    other = sorted(key for key in theirs | ours if theirs.get(key) != ours.get(key))
    if other:
        says = ", ".join(f"{key}={'null' if theirs.get(key) is None else theirs[key]}" for key in other)
        raise UserError(f"init={name}: is of another model; say {says}, or leave init out")
    model.load_state_dict(trained.model.state_dict())
