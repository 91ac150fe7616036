"""An evaluation, its checkpoint unread."""

from typing import Any

from omegaconf import DictConfig, OmegaConf

from stereo_occ.baselines.config import baseline_problems
from stereo_occ.checks.pairs import folder_problems
from stereo_occ.checks.running import control_problems, hardware_problems
from stereo_occ.checks.values import MOST_CELLS, MOST_POINTS, at_least, at_most, known
from stereo_occ.cores import beyond_cores
from stereo_occ.data.splits import SUBSETS
from stereo_occ.packaged import is_there


def check_evaluation(cfg: DictConfig) -> list[str]:
    """Problems of an evaluation configuration, its checkpoint unread."""
    problems = [
        *(control_problems(cfg) if cfg.control is not None else []),
        *at_least(1, cfg, "views", "points", "batch_size", "mesh_resolution", "surface_points"),
        *at_least(0, cfg, "meshes", "examples", "workers"),
        *at_most(MOST_CELLS, cfg, "mesh_resolution"),
        *at_most(MOST_POINTS, cfg, "points", "surface_points"),
        *beyond_cores("workers", cfg.workers),
        *known("subset", cfg.subset, (*SUBSETS, "all", "auto")),
        *hardware_problems(cfg),
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
        problems += folder_problems(cfg)
    return problems
