"""What a configuration must satisfy beyond types: every problem, one line each with key, value and remedy."""

from collections.abc import Iterator, Sequence
from math import inf, isclose, isfinite
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf

from stereo_occ.baselines.config import baseline_problems
from stereo_occ.cores import beyond_cores
from stereo_occ.data.config import SplitKind
from stereo_occ.data.controls import CONTROLS
from stereo_occ.data.look import check_look
from stereo_occ.data.rigs import (
    DISTANCE,
    FOV,
    HALF_ANGLE,
    RectifiedRigConfig,
    RigConfig,
    ToedInRigConfig,
    build_rig,
)
from stereo_occ.data.scene import draw_scene
from stereo_occ.data.splits import SUBSETS, split_views, subset_sizes
from stereo_occ.errors import UserError
from stereo_occ.group import started_elsewhere
from stereo_occ.loggers.config import LoggerConfig, logger_problems
from stereo_occ.models.build import build_model, of_one_rig
from stereo_occ.optimization import OPTIMIZERS, SCHEDULES
from stereo_occ.packaged import is_there, shipped
from stereo_occ.precision import PRECISIONS, on_gpu
from stereo_occ.problems import nearest
from stereo_occ.shapes.shape import CATEGORIES

ACCELERATORS = ("cpu", "gpu", "auto")
LARGEST_SIDE = 4096

#: Of meshes per side of the cube and of samples, which have to be held in memory.
MOST_CELLS = 512
MOST_POINTS = 10_000_000
LOOKS = ("lights", "material", "texture", "background", "sensor")


def check_pairs(cfg: DictConfig) -> list[str]:
    """Problems of the part of a configuration that describes stereo pairs."""
    places = [*_placement(cfg), *_rig(cfg)]
    return [*_objects(cfg), *(places or _scene(cfg)), *_appearance(cfg)]


def check_rendering(cfg: DictConfig) -> list[str]:
    """Problems of a rendering configuration."""
    return [*check_pairs(cfg), *_known("subset", cfg.subset, (*SUBSETS, "all")), *_slice(cfg)]


def check_training(cfg: DictConfig) -> list[str]:
    """Problems of a training configuration."""
    pairs = check_pairs(cfg)
    return [
        *pairs,
        *([] if pairs else [*_split(cfg), *_model(cfg)]),
        *_schedule(cfg),
        *_control(cfg),
        *_aids(cfg),
        *_settings(cfg),
        *_logger(cfg),
        *_hardware(cfg),
        *_processes(cfg),
    ]


def check_evaluation(cfg: DictConfig) -> list[str]:
    """Problems of an evaluation configuration, its checkpoint unread."""
    problems = [
        *(_control(cfg) if cfg.control is not None else []),
        *_at_least(1, cfg, "views", "points", "batch_size", "mesh_resolution", "surface_points"),
        *_at_least(0, cfg, "meshes", "examples", "workers"),
        *_at_most(MOST_CELLS, cfg, "mesh_resolution"),
        *_at_most(MOST_POINTS, cfg, "points", "surface_points"),
        *beyond_cores("workers", cfg.workers),
        *_known("subset", cfg.subset, (*SUBSETS, "all", "auto")),
        *_hardware(cfg),
    ]
    if cfg.checkpoint is None and cfg.baseline is None:
        problems.append("checkpoint: no value given; add checkpoint=... or baseline=...")
    elif cfg.checkpoint is not None and not is_there(cfg.checkpoint):
        problems.append(
            f"checkpoint={cfg.checkpoint}: no such file; give the path of a .ckpt file of a training run"
        )
    if cfg.checkpoint is not None and cfg.training:
        problems.append(f"training={cfg.training}: the checkpoint says what it was trained on; leave one out")
    if cfg.baseline is not None:
        baseline: Any = OmegaConf.to_object(cfg.baseline)
        problems += baseline_problems(baseline)
    if cfg.data is not None and "root" in cfg.data:
        problems += _folder(cfg)
    return problems


def _slice(cfg: DictConfig) -> Iterator[str]:
    yield from _at_least(1, cfg, "slice.of")
    if not 1 <= cfg.slice.index <= max(1, cfg.slice.of):
        yield f"slice.index={cfg.slice.index}: must be 1 to slice.of={cfg.slice.of}"


def _objects(cfg: DictConfig) -> Iterator[str]:
    yield from _at_least(1, cfg, "data.views", "data.image_side", "data.pool_size")
    yield from _at_most(MOST_POINTS, cfg, "data.pool_size")
    yield from _at_least(0, cfg, "data.seed", "workers")
    yield from beyond_cores("workers", cfg.workers)
    if cfg.data.image_side > LARGEST_SIDE:
        yield f"data.image_side={cfg.data.image_side}: must be at most {LARGEST_SIDE} pixels, which OpenGL can draw"
    names = list(cfg.categories.names)
    for name in names:
        yield from _known("categories.names", name, CATEGORIES)
    if len(set(names)) < len(names):
        yield f"categories.names={names}: names a category twice; name each once"
    if not names:
        yield f"categories.names=[]: names no category; name at least one of {', '.join(CATEGORIES)}"
    if cfg.data.name == "procedural":
        counts = cfg.data.counts
        for name in counts:
            if name not in CATEGORIES:
                yield f"data.counts.{name}: unknown category; {nearest(name, CATEGORIES)}"
        for name in names:
            if name in CATEGORIES and counts.get(name, 0) < 1:
                yield (
                    f"data.counts.{name}={counts.get(name)}: must be at least 1; "
                    f"or leave {name} out of categories.names"
                )
    else:
        yield from _folder(cfg)
    fractions = list(cfg.data.fractions)
    if len(fractions) != 3 or not isclose(sum(fractions), 1) or min(fractions) < 0:
        yield f"data.fractions={fractions}: must be three shares (train, val, test) that add up to 1"


def _folder(cfg: DictConfig) -> Iterator[str]:
    if not Path(cfg.data.root).is_dir():
        yield f"data.root={cfg.data.root}: no such folder; give the folder of the meshes"
    if not cfg.data.time_limit > 0:
        yield f"data.time_limit={cfg.data.time_limit}: must be above 0 seconds"
    if not cfg.data.memory_limit >= 1:
        yield f"data.memory_limit={cfg.data.memory_limit}: must be at least 1 GB"


def _placement(cfg: DictConfig) -> Iterator[str]:
    diagonal = list(cfg.placement.diagonal)
    if len(diagonal) != 2 or not 0 < diagonal[0] <= diagonal[1] <= 1:
        yield (
            f"placement.diagonal={diagonal}: must be [low, high] with 0 < low <= high <= 1 metre, "
            f"the working volume's side"
        )


def _rig(cfg: DictConfig) -> Iterator[str]:
    if cfg.rig.kind != ToedInRigConfig.kind:
        return  # drawing a scene tells
    for key, (least, most) in (("distance", DISTANCE), ("half_angle_deg", HALF_ANGLE), ("fov_deg", FOV)):
        if not least <= cfg.rig[key] <= most:
            yield f"rig.{key}={cfg.rig[key]}: must be {least:g} to {most:g}"


def _scene(cfg: DictConfig) -> Iterator[str]:
    """Draw one, of a cube."""
    corners_83 = (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) / 3**0.5
    rig, placement = (OmegaConf.to_object(cfg[name]) for name in ("rig", "placement"))
    rngs = (np.random.default_rng(seed) for seed in range(2))
    yield from _refusal(draw_scene, rig, placement, max(1, cfg.data.image_side), corners_83, *rngs)


def _appearance(cfg: DictConfig) -> Iterator[str]:
    for key in ("low", "high"):
        if len(cfg.background[key]) != 3:
            yield f"background.{key}={cfg.background[key]}: must be three values, red, green and blue"
            return
    if not 0 <= cfg.background.masked <= 1:
        yield f"background.masked={cfg.background.masked}: is a share of the view pairs, 0 to 1"
    parts = {name: OmegaConf.to_object(cfg[name]) for name in LOOKS}
    yield from _refusal(check_look, *(parts[name] for name in LOOKS))


def _split(cfg: DictConfig) -> Iterator[str]:
    data = cfg.data
    if min(data.fractions[:2]) == 0:
        yield f"data.fractions={data.fractions}: training needs a share for train and one for val"
    elif data.split is SplitKind.view:
        refused = list(_refusal(subset_sizes, data.views, data.fractions, "data.views"))
        yield from refused
        if not refused and cfg.validation.views > len(split_views(data.views, data.fractions, "val")):
            yield f"validation.views={cfg.validation.views}: data.split=view leaves fewer of data.views={data.views}"
    elif data.name == "procedural":
        for name in cfg.categories.names:
            yield from _refusal(subset_sizes, data.counts[name], data.fractions, f"data.counts.{name}")


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
        yield from _refusal(build_model, OmegaConf.to_container(cfg.model, resolve=True), rig, False)


def _schedule(cfg: DictConfig) -> Iterator[str]:
    if cfg.steps < 1:  # the other keys may be derived from it
        yield from _at_least(1, cfg, "steps")
        return
    keys = ("interval", "views", "points", "checkpoint_interval")
    yield from _at_least(1, cfg, *(f"validation.{key}" for key in keys))
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


def _control(cfg: DictConfig) -> Iterator[str]:
    name, degrees = cfg.control.name, cfg.control.degrees
    yield from _known("control.name", name, CONTROLS)
    if name == "calibration_off" and not 0 < degrees <= 180:
        yield f"control.degrees={degrees}: must be above 0 and at most 180"
    elif name != "calibration_off" and degrees:
        yield f"control.degrees={degrees}: control={name} turns no camera; leave it at 0"


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
    yield from _at_least(0, cfg, "auxiliary.mask", "auxiliary.depth", "auxiliary.surface")
    decay = cfg.averaging.decay
    if decay is not None and not 0 <= decay < 1:
        yield f"averaging.decay={decay}: must be at least 0 and below 1, or null"


def _settings(cfg: DictConfig) -> Iterator[str]:
    yield from _at_least(1, cfg, "points", "batch_size", "logger.interval", "logger.mesh_resolution")
    yield from _at_most(MOST_CELLS, cfg, "logger.mesh_resolution")
    yield from _at_least(0, cfg, "seed", "scheduler.warmup", "logger.examples", "optimizer.weight_decay")
    for key in ("points", "validation.points"):
        if _value(cfg, key) > cfg.data.pool_size:
            yield f"{key}={_value(cfg, key)}: there are only data.pool_size={cfg.data.pool_size} points per object"
    for key in ("optimizer.lr", "trainer.gradient_clip"):
        if _value(cfg, key) is not None and not 0 < _value(cfg, key) < inf:
            yield f"{key}={_value(cfg, key)}: must be above 0 and finite"
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
    yield from _known("optimizer.name", cfg.optimizer.name, OPTIMIZERS)
    yield from _known("scheduler.name", cfg.scheduler.name, SCHEDULES)
    if not 0 <= cfg.scheduler.final <= 1:
        yield f"scheduler.final={cfg.scheduler.final}: must be a share of the first learning rate, 0 to 1"
    betas = list(cfg.optimizer.betas)
    if len(betas) != 2 or not all(0 <= beta < 1 for beta in betas):
        yield f"optimizer.betas={betas}: must be two numbers in [0, 1)"


def _logger(cfg: DictConfig) -> Iterator[str]:
    config = OmegaConf.to_object(cfg.logger)
    assert isinstance(config, LoggerConfig)
    yield from logger_problems(config)


def _hardware(cfg: DictConfig) -> Iterator[str]:
    trainer = cfg.trainer
    yield from _at_least(0, cfg, "trainer.workers")
    yield from beyond_cores("trainer.workers", trainer.workers)
    if trainer.threads is not None:
        yield from _at_least(1, cfg, "trainer.threads")
        yield from beyond_cores("trainer.threads", trainer.threads)
    yield from _known("trainer.precision", trainer.precision, PRECISIONS)
    yield from _known("trainer.accelerator", trainer.accelerator, ACCELERATORS)
    if trainer.accelerator == "gpu" and not torch.cuda.is_available():
        yield "trainer.accelerator=gpu: PyTorch sees no GPU here; say trainer=cpu"
    elif trainer.precision == "16-mixed" and not on_gpu(trainer.accelerator):
        yield "trainer.precision=16-mixed: processors have no half precision; say auto"


def _processes(cfg: DictConfig) -> Iterator[str]:
    devices, nodes = cfg.trainer.devices, cfg.trainer.nodes
    few = list(_at_least(1, cfg, "trainer.devices", "trainer.nodes"))
    yield from few
    yield from beyond_cores("trainer.devices", devices)
    if not few and cfg.batch_size % (devices * nodes):
        yield f"batch_size={cfg.batch_size}: must be a multiple of the {devices * nodes} processes that share a batch"
    if not few and nodes > 1 and not started_elsewhere():
        yield f"trainer.nodes={nodes}: processes on several machines are started by Slurm or torchrun: docs/cluster.md"


def _at_least(minimum: int, cfg: DictConfig, *keys: str) -> Iterator[str]:
    for key in keys:
        if _value(cfg, key) < minimum:
            yield f"{key}={_value(cfg, key)}: must be at least {minimum}"


def _at_most(maximum: int, cfg: DictConfig, *keys: str) -> Iterator[str]:
    for key in keys:
        if _value(cfg, key) > maximum:
            yield f"{key}={_value(cfg, key)}: must be at most {maximum}"


def _known(key: str, value: str, known: Sequence[str] | dict[str, Any]) -> Iterator[str]:
    if value not in known:
        yield f"{key}={value}: unknown; {nearest(value, known)}"


def _refusal(function: Any, *arguments: Any) -> Iterator[str]:
    try:
        function(*arguments)
    except UserError as error:
        yield str(error)


def _value(cfg: DictConfig, key: str) -> Any:
    return OmegaConf.select(cfg, key)
