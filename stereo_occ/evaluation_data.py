"""Which objects an evaluation measures, and which ones the measured model was trained on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks.pairs import check_pairs
from stereo_occ.config import EvaluateConfig, TrainConfig
from stereo_occ.data.config import SplitKind
from stereo_occ.data.datamodule import PairsDataModule
from stereo_occ.data.dataset import EvaluationPairs
from stereo_occ.data.objects import Objects, ObjectSource, list_objects, members
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


@dataclass(frozen=True)
class OwnObjects:
    """The objects of a model's own training, as its settings give them now.

    Attributes:
        split: objects or views.
        pairs, objects: its settings and their objects; None, with the ``problem``, where there are no longer any.
        train, val: what the model learnt from, and what its checkpoint was chosen by.
    """

    split: SplitKind
    pairs: TrainConfig | None = None
    objects: Objects | None = None
    train: list[ObjectSource] = field(default_factory=list)
    val: list[ObjectSource] = field(default_factory=list)
    problem: str = ""

    @classmethod
    def of(cls, cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig) -> "OwnObjects":
        """Of a training configuration, with the paths of the evaluation ``cfg``."""
        split = trained.data.split
        try:
            pairs = _typed(trained.copy(), cfg)
            objects = list_objects(pairs, settings.progress)
            train, val = (members(objects.sources, pairs, subset) for subset in ("train", "val"))
        except UserError as error:
            return cls(split, problem=str(error))
        return cls(split, pairs, objects, train, val)

    def seen(self, noted: Mapping[str, list[str]] | None) -> Mapping[str, list[str]]:
        """Identities by subset: those ``noted`` in the checkpoint, or of old ones these; none if views are split."""
        if self.split is SplitKind.view:
            return {}
        if noted is not None:
            return noted
        return {name: [source.identity for source in getattr(self, name)] for name in ("train", "val")}

    def training_pairs(self, settings: EvaluateConfig) -> Callable[[str], EvaluationPairs]:
        """A function that gives the pairs of ``train``, or of ``val`` as many of each object as are evaluated.

        Raises:
            UserError: the objects can no longer be listed.
        """
        if self.pairs is None:
            raise UserError(self.problem)
        typed = self.pairs

        def pairs(subset: str) -> EvaluationPairs:
            shards, views = _module(typed, settings, subset, self.objects).subset(subset)
            count = settings.views if subset == "val" else len(views)
            return EvaluationPairs(shards, views[:count], min(settings.points, typed.data.pool_size))

        return pairs

    def split_facts(self, evaluated: Sequence[ObjectSource]) -> dict[str, object]:
        """``hash`` of the names of training and evaluated objects, and their numbers; see ``provenance``.

        Where the training objects can no longer be listed, ``hash`` is None and ``reason`` says why.
        """
        if self.pairs is None:
            return {"hash": None, "evaluated": len(evaluated), "reason": self.problem}
        return {
            "hash": split_hash(self.train, evaluated),
            "training": len(self.train),
            "evaluated": len(evaluated),
            "kind": self.split.value,
        }


def evaluated_pairs(
    cfg: DictConfig, settings: EvaluateConfig, trained: DictConfig, own: OwnObjects
) -> PairsDataModule:
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
    same = cfg.data is None and cfg.categories is None
    return _module(_typed(pairs, cfg), settings, settings.subset, own.objects if same else None)


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


def _typed(pairs: DictConfig, cfg: DictConfig) -> TrainConfig:
    pairs.paths, pairs.workers = cfg.paths, cfg.workers
    problems = check_pairs(pairs)
    if problems:
        raise UserError("; ".join(problems))
    typed = OmegaConf.to_object(pairs)
    assert isinstance(typed, TrainConfig)
    return typed


def _module(
    typed: TrainConfig, settings: EvaluateConfig, subset: str, objects: Objects | None
) -> PairsDataModule:
    return PairsDataModule(
        typed,
        control=typed.control,
        evaluation_views=settings.views,
        evaluation_points=settings.points,
        evaluation_batch_size=settings.batch_size,
        workers=settings.trainer.workers,
        progress=settings.progress,
        only=subset,
        objects=objects,
    )
