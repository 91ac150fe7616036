"""What a configuration must satisfy beyond types: every problem, one line each with key, value and remedy."""

from collections.abc import Iterator
from math import isclose
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from stereo_occ.cli import nearest
from stereo_occ.data.prepare import build_rig
from stereo_occ.errors import UserError
from stereo_occ.models.build import ENCODERS
from stereo_occ.optimization import OPTIMIZERS, SCHEDULES
from stereo_occ.shapes.shape import CATEGORIES

PRECISIONS = ("32-true", "bf16-mixed", "16-mixed")


def check_pairs(cfg: DictConfig) -> list[str]:
    """Problems of the part of a configuration that describes stereo pairs."""
    return list(_pairs(cfg))


def check_training(cfg: DictConfig) -> list[str]:
    """Problems of a training configuration."""
    return [*_pairs(cfg), *_training(cfg)]


def check_evaluation(cfg: DictConfig) -> list[str]:
    """Problems of an evaluation configuration."""
    problems = list(_positive(cfg, "views", "points", "batch_size"))
    if not Path(cfg.checkpoint).is_file():
        problems.append(
            f"checkpoint={cfg.checkpoint}: no such file; give the path of a .ckpt file of a training run"
        )
    if cfg.data is not None and cfg.data.name == "meshes":
        problems += _folder(cfg)
    return problems


def _pairs(cfg: DictConfig) -> Iterator[str]:
    yield from _positive(cfg, "data.views", "data.image_side", "data.pool_size")
    names = list(cfg.categories.names)
    yield from (
        f"categories.names={name}: unknown category; {nearest(name, CATEGORIES)}"
        for name in names
        if name not in CATEGORIES
    )
    if not names:
        yield f"categories.names: is empty; name at least one of {', '.join(CATEGORIES)}"
    if cfg.data.name == "procedural":
        counts = cfg.data.counts
        yield from (
            f"data.counts.{name}: unknown category; {nearest(name, CATEGORIES)}"
            for name in counts
            if name not in CATEGORIES
        )
        for name in names:
            if name in CATEGORIES and counts.get(name, 0) < 1:
                yield f"data.counts.{name}={counts.get(name)}: must be at least 1; or leave it out of categories.names"
    if cfg.data.name == "meshes":
        yield from _folder(cfg)
    fractions = list(cfg.data.fractions)
    if len(fractions) != 3 or not isclose(sum(fractions), 1) or min(fractions) < 0:
        yield f"data.fractions={fractions}: must be three shares (train, val, test) that add up to 1"
    low, high = cfg.placement.diagonal
    if not 0 < low <= high <= 1:
        yield f"placement.diagonal={[low, high]}: must be 0 < low <= high <= 1 metre, the working volume's side"
    if cfg.data.image_side > 0:
        try:
            build_rig(cfg.rig, cfg.data.image_side)
        except UserError as error:
            yield str(error)


def _training(cfg: DictConfig) -> Iterator[str]:
    yield from _positive(
        cfg, "steps", "points", "batch_size", "optimizer.lr", "validation.interval", "validation.views",
        "validation.points", "validation.checkpoint_interval", "trainer.devices", "logger.interval",
    )  # fmt: skip
    if cfg.validation.interval > 0 and cfg.steps % cfg.validation.interval:
        yield (
            f"steps={cfg.steps}: is not a multiple of validation.interval={cfg.validation.interval}, so the last state "
            f"would not be validated; make it {_next_multiple(cfg.steps, cfg.validation.interval)}"
        )
    multiple = ENCODERS[cfg.model.encoder.name].image_multiple
    if cfg.data.image_side % multiple:
        yield (
            f"data.image_side={cfg.data.image_side}: must be a multiple of {multiple} for "
            f"model/encoder={cfg.model.encoder.name}; make it {_next_multiple(cfg.data.image_side, multiple)}"
        )
    if cfg.validation.views > cfg.data.views:
        yield f"validation.views={cfg.validation.views}: there are only data.views={cfg.data.views} per object"
    if cfg.validation.points > cfg.data.pool_size:
        yield f"validation.points={cfg.validation.points}: there are only data.pool_size={cfg.data.pool_size} points"
    shares = [cfg.queries.box, cfg.queries.outside, cfg.queries.surface]
    if not isclose(sum(shares), 1) or min(shares) < 0:
        yield f"queries={shares}: box, outside and surface must be shares that add up to 1"
    yield from _known("optimizer.name", cfg.optimizer.name, OPTIMIZERS)
    yield from _known("scheduler.name", cfg.scheduler.name, SCHEDULES)
    yield from _known("trainer.precision", cfg.trainer.precision, PRECISIONS)
    if len(cfg.optimizer.betas) != 2 or not all(0 <= beta < 1 for beta in cfg.optimizer.betas):
        yield f"optimizer.betas={list(cfg.optimizer.betas)}: must be two numbers in [0, 1)"


def _folder(cfg: DictConfig) -> list[str]:
    if Path(cfg.data.root).is_dir():
        return []
    return [f"data.root={cfg.data.root}: no such folder; give a folder laid out as category/name/model.*"]


def _positive(cfg: DictConfig, *keys: str) -> Iterator[str]:
    for key in keys:
        value: Any = cfg
        for part in key.split("."):
            value = value[part]
        if not value > 0:
            yield f"{key}={value}: must be positive"


def _known(key: str, value: str, known: Any) -> Iterator[str]:
    if value not in known:
        yield f"{key}={value}: unknown; {nearest(value, known)}"


def _next_multiple(value: int, of: int) -> int:
    return -(-value // of) * of
