"""Which objects an evaluation measures, and which ones the measured model was trained on."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks import check_pairs
from stereo_occ.config import EvaluateConfig, TrainConfig
from stereo_occ.data.config import SplitKind
from stereo_occ.data.datamodule import PairsDataModule
from stereo_occ.data.dataset import EvaluationPairs
from stereo_occ.data.objects import ObjectSource, list_objects, members, training_objects
from stereo_occ.errors import UserError
from stereo_occ.provenance import split_hash

GROUPS = ("data", "rig", "placement", "lights", "material", "texture", "background", "sensor", "categories")


def own_settings(cfg: DictConfig) -> EvaluateConfig:
    """The settings without the groups that complete the training's: these may refer to its values."""
    own = cfg.copy()
    for group in GROUPS:
        own[group] = None
    settings = OmegaConf.to_object(own)
    assert isinstance(settings, EvaluateConfig)
    return settings


def has_other_meshes(cfg: DictConfig, trained: DictConfig) -> bool:
    """Whether the objects asked for are meshes that the model cannot have been trained on."""
    asked, own = (OmegaConf.select(config, "data.root") for config in (cfg, trained))
    return asked is not None and (own is None or Path(asked).resolve() != Path(own).resolve())


def evaluated_pairs(cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig) -> PairsDataModule:
    """The pairs of the training's own data, with the groups replaced that the command line gives.

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
    return _module(_typed(pairs, cfg), settings, settings.subset)


def training_pairs(
    cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig
) -> Callable[[str], EvaluationPairs]:
    """A function that gives the pairs of ``train``, or of ``val`` as many of each object as are evaluated."""
    typed = _typed(trained.copy(), cfg)

    def pairs(subset: str) -> EvaluationPairs:
        shards, views = _module(typed, settings, subset).subset(subset)
        if not shards:
            raise UserError(f"data.fractions={typed.data.fractions}: leaves no object for {subset}")
        count = settings.views if subset == "val" else len(views)
        return EvaluationPairs(shards, views[:count], min(settings.points, typed.data.pool_size))

    return pairs


def seen_objects(
    cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig, noted: Mapping[str, list[str]] | None
) -> Mapping[str, list[str]]:
    """Identities of the objects of a training: those noted in its checkpoint, else those that its settings give now.

    There are none where these can no longer be listed, or where the subsets share all objects.
    """
    if trained.data.split == SplitKind.view:
        return {}
    if noted is not None:
        return noted
    try:
        return training_objects(_typed(trained.copy(), cfg), settings.progress)
    except UserError:
        return {}


def check_unseen(asked: str, evaluated: Sequence[ObjectSource], seen: Mapping[str, list[str]]) -> None:
    """Refuse to call objects new that a training has learnt from or chosen by.

    Args:
        asked: the subset, as it was asked for: ``train`` and ``all`` may have any.

    Raises:
        UserError: the list of objects is no longer the training's, or holds copies of its objects.
    """
    if asked in ("train", "all"):
        return
    subsets = ("train",) if asked == "val" else ("train", "val")
    known = {identity for subset in subsets for identity in seen.get(subset, ())}
    found = ["/".join(source.key) for source in evaluated if source.identity in known]
    if found:
        raise UserError(
            f"subset={asked}: {len(found)} of the {len(evaluated)} objects were in the model's training or validation "
            f"({found[0]} is one): the data set has changed since, or holds copies; give it as it was, or other "
            f"objects, or say subset=all to measure these nonetheless"
        )


def split_facts(
    cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig, data: PairsDataModule
) -> dict[str, object]:
    """``hash`` of the names of the training and the evaluated objects, and their numbers; see ``provenance``.

    Where the training objects can no longer be listed, ``hash`` is None and ``reason`` says why.
    """
    assert data.prepared is not None
    evaluated = data.prepared.sources
    try:
        typed = _typed(trained.copy(), cfg)
        training = members(list_objects(typed, settings.progress).sources, typed, "train")
    except UserError as error:
        return {"hash": None, "evaluated": len(evaluated), "reason": str(error)}
    return {
        "hash": split_hash(training, evaluated),
        "training": len(training),
        "evaluated": len(evaluated),
        "kind": typed.data.split.value,
    }


def _typed(pairs: DictConfig, cfg: DictConfig) -> TrainConfig:
    pairs.paths, pairs.workers = cfg.paths, cfg.workers
    problems = check_pairs(pairs)
    if problems:
        raise UserError("; ".join(problems))
    typed = OmegaConf.to_object(pairs)
    assert isinstance(typed, TrainConfig)
    return typed


def _module(typed: TrainConfig, settings: EvaluateConfig, subset: str) -> PairsDataModule:
    return PairsDataModule(
        typed,
        control=typed.control,
        evaluation_views=settings.views,
        evaluation_points=settings.points,
        evaluation_batch_size=settings.batch_size,
        workers=settings.trainer.workers,
        progress=settings.progress,
        only=subset,
    )
