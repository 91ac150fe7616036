"""Objects, and the pairs that show them."""

from collections.abc import Iterator
from math import isclose
from pathlib import Path

import numpy as np
from omegaconf import DictConfig, OmegaConf

from stereo_occ.advice import nearest
from stereo_occ.checks.values import MOST_POINTS, at_least, at_most, known, refusal
from stereo_occ.cores import beyond_cores
from stereo_occ.data.look import check_look
from stereo_occ.data.rigs import DISTANCE, FOV, HALF_ANGLE, ToedInRigConfig
from stereo_occ.data.scene import draw_scene
from stereo_occ.data.splits import SUBSETS
from stereo_occ.shapes.shape import CATEGORIES

LARGEST_SIDE = 4096
LOOKS = ("lights", "material", "texture", "background", "sensor")


def check_pairs(cfg: DictConfig) -> list[str]:
    """Problems of the part of a configuration that describes stereo pairs."""
    places = [*_placement(cfg), *_rig(cfg)]
    return [*_objects(cfg), *(places or _scene(cfg)), *_appearance(cfg)]


def check_rendering(cfg: DictConfig) -> list[str]:
    """Problems of a rendering configuration."""
    return [*check_pairs(cfg), *known("subset", cfg.subset, (*SUBSETS, "all")), *_slice(cfg)]


def _slice(cfg: DictConfig) -> Iterator[str]:
    yield from at_least(1, cfg, "slice.of")
    if not 1 <= cfg.slice.index <= max(1, cfg.slice.of):
        yield f"slice.index={cfg.slice.index}: must be 1 to slice.of={cfg.slice.of}"


def _objects(cfg: DictConfig) -> Iterator[str]:
    yield from at_least(1, cfg, "data.views", "data.image_side", "data.pool_size")
    yield from at_most(MOST_POINTS, cfg, "data.pool_size")
    yield from at_least(0, cfg, "data.seed", "workers")
    yield from beyond_cores("workers", cfg.workers)
    if cfg.data.image_side > LARGEST_SIDE:
        yield f"data.image_side={cfg.data.image_side}: must be at most {LARGEST_SIDE} pixels, which OpenGL can draw"
    names = list(cfg.categories.names)
    for name in names:
        yield from known("categories.names", name, CATEGORIES)
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
        yield from folder_problems(cfg)
    fractions = list(cfg.data.fractions)
    if len(fractions) != 3 or not isclose(sum(fractions), 1) or min(fractions) < 0:
        yield f"data.fractions={fractions}: must be three shares (train, val, test) that add up to 1"


def folder_problems(cfg: DictConfig) -> Iterator[str]:
    """Of a folder of one's own meshes and the limits on reading them."""
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
    yield from refusal(draw_scene, rig, placement, max(1, cfg.data.image_side), corners_83, *rngs)


def _appearance(cfg: DictConfig) -> Iterator[str]:
    for key in ("low", "high"):
        if len(cfg.background[key]) != 3:
            yield f"background.{key}={cfg.background[key]}: must be three values, red, green and blue"
            return
    if not 0 <= cfg.background.masked <= 1:
        yield f"background.masked={cfg.background.masked}: is a share of the view pairs, 0 to 1"
    parts = {name: OmegaConf.to_object(cfg[name]) for name in LOOKS}
    yield from refusal(check_look, *(parts[name] for name in LOOKS))
