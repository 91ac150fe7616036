"""A training: its objects, model, schedule and settings."""

from collections.abc import Iterator
from math import inf, isclose, isfinite

import torch
from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks.pairs import check_pairs
from stereo_occ.checks.running import control_problems, hardware_problems
from stereo_occ.checks.values import MOST_CELLS, at_least, at_most, known, refusal, value_of
from stereo_occ.cores import beyond_cores
from stereo_occ.data.config import SplitKind
from stereo_occ.data.rigs import RectifiedRigConfig, RigConfig, ToedInRigConfig, build_rig
from stereo_occ.data.splits import split_views, subset_sizes
from stereo_occ.group import started_elsewhere
from stereo_occ.loggers.config import LoggerConfig, logger_problems
from stereo_occ.models.build import build_model, of_one_rig
from stereo_occ.optimization import OPTIMIZERS, SCHEDULES
from stereo_occ.packaged import is_there, shipped


def check_training(cfg: DictConfig) -> list[str]:
    """Problems of a training configuration."""
    pairs = check_pairs(cfg)
    return [
        *pairs,
        *([] if pairs else [*_split(cfg), *_model(cfg)]),
        *_schedule(cfg),
        *control_problems(cfg),
        *_aids(cfg),
        *_settings(cfg),
        *_logger(cfg),
        *hardware_problems(cfg),
        *_processes(cfg),
    ]


def _split(cfg: DictConfig) -> Iterator[str]:
    data = cfg.data
    if min(data.fractions[:2]) == 0:
        yield f"data.fractions={data.fractions}: training needs a share for train and one for val"
    elif data.split is SplitKind.view:
        refused = list(refusal(subset_sizes, data.views, data.fractions, "data.views"))
        yield from refused
        if not refused and cfg.validation.views > len(split_views(data.views, data.fractions, "val")):
            yield f"validation.views={cfg.validation.views}: data.split=view leaves fewer of data.views={data.views}"
    elif data.name == "procedural":
        for name in cfg.categories.names:
            yield from refusal(subset_sizes, data.counts[name], data.fractions, f"data.counts.{name}")


def _model(cfg: DictConfig) -> Iterator[str]:
    """Build the model without its weights."""
    config = OmegaConf.to_object(cfg.rig)
    assert isinstance(config, RigConfig)
    rig = build_rig(config, cfg.data.image_side)
    if cfg.rig.kind != ToedInRigConfig.kind and of_one_rig(cfg.model):
        yield (
            f"model.cost_volume.name={cfg.model.cost_volume.name}: has the disparities of one rig, and rig.kind="
            f"{cfg.rig.kind} gives each pair its own; say model/cost_volume=plane_sweep, which reads the cameras"
        )
    with torch.device("meta"):
        yield from refusal(build_model, OmegaConf.to_container(cfg.model, resolve=True), rig, False)


def _schedule(cfg: DictConfig) -> Iterator[str]:
    if cfg.steps < 1:  # the other keys may be derived from it
        yield from at_least(1, cfg, "steps")
        return
    keys = ("interval", "views", "points", "checkpoint_interval")
    yield from at_least(1, cfg, *(f"validation.{key}" for key in keys))
    interval = cfg.validation.interval
    if interval > 0 and cfg.steps % interval:
        whole = max(1, cfg.steps // interval) * interval
        yield (
            f"steps={cfg.steps}: is not a multiple of validation.interval={interval}, so the last state would not be "
            f"validated; say steps={whole} validation.interval={interval}"
        )
    if cfg.scheduler.warmup > cfg.steps:
        yield (
            f"scheduler.warmup={cfg.scheduler.warmup}: is longer than steps={cfg.steps}, so the learning rate would "
            f"never be optimizer.lr; warm up for fewer steps"
        )
    if cfg.validation.views > cfg.data.views:
        yield f"validation.views={cfg.validation.views}: there are only data.views={cfg.data.views} per object"


def _aids(cfg: DictConfig) -> Iterator[str]:
    augmentation = cfg.augmentation
    upper = {"brightness": 1, "contrast": 1, "noise": 1, "blur": 8, "mirror": 1, "roll_deg": 180}
    for key, limit in upper.items():
        if not 0 <= augmentation[key] <= limit:
            yield f"augmentation.{key}={augmentation[key]}: must be between 0 and {limit}"
    if augmentation.roll_deg and cfg.model.name in ("mono", "stereo"):
        yield (
            f"augmentation.roll_deg={augmentation.roll_deg}: model={cfg.model.name} has no way to know how its cameras "
            f"have rolled; say augmentation.roll_deg=0"
        )
    elif augmentation.roll_deg and cfg.rig.kind == RectifiedRigConfig.kind:
        yield (
            f"augmentation.roll_deg={augmentation.roll_deg}: would turn the crops of rig.kind={cfg.rig.kind} about "
            f"points outside of them, and the object out of the picture; say augmentation.roll_deg=0"
        )
    yield from at_least(0, cfg, "auxiliary.mask", "auxiliary.depth", "auxiliary.surface")
    decay = cfg.averaging.decay
    if decay is not None and not 0 <= decay < 1:
        yield f"averaging.decay={decay}: must be at least 0 and below 1, or null"


def _settings(cfg: DictConfig) -> Iterator[str]:
    yield from at_least(1, cfg, "points", "batch_size", "logger.interval", "logger.mesh_resolution")
    yield from at_most(MOST_CELLS, cfg, "logger.mesh_resolution")
    yield from at_least(0, cfg, "seed", "scheduler.warmup", "logger.examples", "optimizer.weight_decay")
    for key in ("points", "validation.points"):
        if value_of(cfg, key) > cfg.data.pool_size:
            yield f"{key}={value_of(cfg, key)}: there are only data.pool_size={cfg.data.pool_size} points per object"
    for key in ("optimizer.lr", "trainer.gradient_clip"):
        if value_of(cfg, key) is not None and not 0 < value_of(cfg, key) < inf:
            yield f"{key}={value_of(cfg, key)}: must be above 0 and finite"
    if cfg.init is not None and not is_there(cfg.init):
        yield (
            f"init={cfg.init}: no such file, nor the name of shipped weights ({', '.join(shipped())}); "
            f"give the best.ckpt of a training run"
        )
    if not isfinite(cfg.optimizer.weight_decay):
        yield f"optimizer.weight_decay={cfg.optimizer.weight_decay}: must be at least 0 and finite"
    shares = [cfg.queries.box, cfg.queries.outside, cfg.queries.surface]
    if not isclose(sum(shares), 1) or min(shares) < 0:
        yield f"queries={shares}: box, outside and surface must be shares that add up to 1"
    yield from known("optimizer.name", cfg.optimizer.name, OPTIMIZERS)
    yield from known("scheduler.name", cfg.scheduler.name, SCHEDULES)
    if not 0 <= cfg.scheduler.final <= 1:
        yield f"scheduler.final={cfg.scheduler.final}: must be a share of the first learning rate, 0 to 1"
    betas = list(cfg.optimizer.betas)
    if len(betas) != 2 or not all(0 <= beta < 1 for beta in betas):
        yield f"optimizer.betas={betas}: must be two numbers in [0, 1)"


def _logger(cfg: DictConfig) -> Iterator[str]:
    config = OmegaConf.to_object(cfg.logger)
    assert isinstance(config, LoggerConfig)
    yield from logger_problems(config)


def _processes(cfg: DictConfig) -> Iterator[str]:
    devices, nodes = cfg.trainer.devices, cfg.trainer.nodes
    few = list(at_least(1, cfg, "trainer.devices", "trainer.nodes"))
    yield from few
    yield from beyond_cores("trainer.devices", devices)
    if not few and cfg.batch_size % (devices * nodes):
        yield f"batch_size={cfg.batch_size}: must be a multiple of the {devices * nodes} processes that share a batch"
    if not few and nodes > 1 and not started_elsewhere():
        yield f"trainer.nodes={nodes}: processes on several machines are started by Slurm or torchrun: docs/cluster.md"
