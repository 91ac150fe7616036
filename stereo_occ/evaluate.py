"""``python -m stereo_occ.evaluate``: every metric of a network or a baseline, one row per object-view, examples.

``metrics.json`` has the keys of :mod:`stereo_occ.metrics_file` and:
    predictor: ``checkpoint`` or ``baseline`` with its settings.
    step, parameters: of the network; null for a baseline.
    trained: of a network, its training's ``config`` and ``history`` (of the whole run where its ``metrics.json`` is
        beside the checkpoint, else up to the checkpoint); null for a baseline.
    control: what the network was shown, see :mod:`stereo_occ.data.controls`; null for a baseline, which has no twin.
    config: the settings of the evaluation.
    subset, data, objects, views, points: what was measured, and the folder of its shards.
    split: ``hash`` of the names of training and evaluated objects, see :func:`~stereo_occ.provenance.split_hash`.
    decision: ``threshold``, chosen on validation objects, and ``rule``, see :mod:`stereo_occ.decision`.
    threshold: decision threshold on the probability, mean over the views.
    skipped: mesh files that gave no object.
    failures: number of object-views by failure; they are counted in every mean.
    meshes: how many views per object had their mesh measured, at which resolution, from how many points.
    reliability: per category, for each bin of probability: points, mean probability, share occupied (of the cube).
    metrics: ``test/<metric>`` (mean of category means), ``test/<metric>/<category>``, ``test/<metric>/all``.

``curves.json`` has ``levels`` of the logit and, per category, ``empty`` and ``occupied``: how many such points of the
cube lie below the first level, between two, above the last (:mod:`stereo_occ.metrics.curves`).
"""

import logging
import time
from collections import Counter
from pathlib import Path
from statistics import fmean
from typing import Any

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from stereo_occ.baselines.build import build_baseline
from stereo_occ.checkpoint import KEY, config_of, plain, read_checkpoint
from stereo_occ.checks.evaluation import check_evaluation
from stereo_occ.cli import compose_config, entry_point
from stereo_occ.config import EvaluateConfig
from stereo_occ.errors import UserError
from stereo_occ.evaluation_data import (
    GROUPS,
    OwnObjects,
    check_unseen,
    evaluated_pairs,
    has_other_meshes,
    own_settings,
)
from stereo_occ.evaluation_files import write_csv, write_examples
from stereo_occ.kept_views import ViewKeeper
from stereo_occ.measurement import Measurement, MeshSettings, measure
from stereo_occ.metrics.calibration import expected_calibration_error
from stereo_occ.metrics.curves import LEVELS
from stereo_occ.metrics.summary import summarise
from stereo_occ.metrics_file import training_history
from stereo_occ.predictors import LearnedPredictor, Predictor
from stereo_occ.provenance import environment
from stereo_occ.quiet import quiet_libraries
from stereo_occ.trained import trained_model
from stereo_occ.writing import write_json

logger = logging.getLogger(__name__)


def evaluate(cfg: DictConfig, folder: Path) -> dict[str, float]:
    """Measure ``cfg.checkpoint`` or ``cfg.baseline`` and write results into ``folder``.

    Returns:
        The metrics, with the keys of ``metrics.json``'s ``metrics``.
    """
    start = time.monotonic()
    quiet_libraries()
    if any((folder / name).is_file() for name in ("best.ckpt", "last.ckpt")):
        raise UserError(
            f"hydra.run.dir={folder}: holds a training, whose metrics.json would be lost; give another folder"
        )
    settings = own_settings(cfg)
    if settings.trainer.threads:
        torch.set_num_threads(settings.trainer.threads)
    checkpoint = read_checkpoint(Path(settings.checkpoint)) if settings.checkpoint else None
    trained = (
        config_of(checkpoint, settings.checkpoint)
        if checkpoint
        else compose_config("train", settings.training)
    )
    if settings.control is not None:
        trained.control = settings.control
    asked = settings.subset
    if asked == "auto":
        settings.subset = "all" if has_other_meshes(cfg, trained) else "test"
    own_objects = OwnObjects.of(cfg, settings, trained)
    data = evaluated_pairs(cfg, settings, trained, own_objects)
    dataset = data.evaluation_dataset(settings.subset)
    assert data.prepared is not None
    noted = checkpoint[KEY].get("objects") if checkpoint else None
    check_unseen(asked, data.prepared.sources, own_objects.seen(noted))
    if noted is None and own_objects.problem:
        logger.warning(
            "the training's objects are neither noted nor found (%s): some of these may be among them",
            own_objects.problem,
        )
    facts: dict[str, Any] = {"step": None, "parameters": None, "trained": None}
    predictor: Predictor
    if settings.baseline is not None:
        predictor = build_baseline(settings.baseline, own_objects.training_pairs(settings), settings.progress)
    else:
        assert checkpoint is not None
        network = trained_model(checkpoint, str(settings.checkpoint))
        facts = {
            "step": network.step,
            "parameters": sum(p.numel() for p in network.model.parameters()),
            "trained": {
                "config": checkpoint[KEY]["config"],
                "history": training_history(Path(str(settings.checkpoint)), checkpoint),
            },
        }
        hardware = settings.trainer
        predictor = LearnedPredictor(
            network.model, network.decision, hardware.accelerator, hardware.precision
        )
    folder.mkdir(parents=True, exist_ok=True)
    meshes = MeshSettings(settings.meshes, settings.mesh_resolution, settings.surface_points)
    keeper = ViewKeeper(folder)
    result = measure(
        predictor,
        dataset,
        data.evaluation_loader(settings.subset),
        meshes,
        settings.progress,
        keeper.keep if settings.keep else None,
    )
    keeper.write_index()
    threshold = round(fmean(result.thresholds), 6)
    metrics = _metrics(result, threshold)
    skipped = [vars(file) for file in data.prepared.skipped]
    write_csv(folder / "per_object.csv", result.rows)
    (folder / "skipped.csv").unlink(missing_ok=True)  # of a former evaluation
    if skipped:
        write_csv(folder / "skipped.csv", skipped)
    write_json(folder / "curves.json", _curves(result))
    write_json(
        folder / "metrics.json",
        environment()
        | {"predictor": _name(cfg), **facts, "config": _config(cfg, settings)}
        | {
            "subset": settings.subset,
            "data": str(data.prepared.folder),
            "objects": len({(row["category"], row["object_id"]) for row in result.rows}),
            "views": settings.views,
            "points": settings.points,
            "split": own_objects.split_facts(data.prepared.sources),
            "decision": {"threshold": predictor.decision.threshold, "rule": predictor.decision.rule.value},
            "threshold": threshold,
            "control": plain(trained.control) if settings.baseline is None else None,
            "skipped": len(skipped),
            "failures": dict(Counter(row["failure"] for row in result.rows if row["failure"])),
            "meshes": vars(meshes),
            "reliability": {name: _reliability(sums_3K) for name, sums_3K in result.reliability.items()},
            "seconds": round(time.monotonic() - start, 1),
            "metrics": metrics,
        },
    )
    write_examples(folder, predictor, dataset, settings.examples, settings.mesh_resolution)
    return metrics


def _metrics(result: Measurement, threshold: float) -> dict[str, float]:
    values = summarise(result.rows)
    pooled = {name: expected_calibration_error(sums) for name, sums in result.reliability.items()}
    values["ece_pooled"] = sum(pooled.values()) / len(pooled)
    values |= {f"ece_pooled/{name}": value for name, value in pooled.items()}
    return {f"test/{name}": value for name, value in (values | {"threshold": threshold}).items()}


def _name(cfg: DictConfig) -> dict[str, Any]:
    return {"checkpoint": cfg.checkpoint} if cfg.baseline is None else {"baseline": plain(cfg.baseline)}


def _config(cfg: DictConfig, settings: EvaluateConfig) -> dict[str, Any]:
    """The settings; of the groups only those given on the command line, values that refer to others unresolved."""
    own = cfg.copy()
    groups = {name: OmegaConf.to_container(own[name], enum_to_str=True) for name in GROUPS if own[name]}
    for name in GROUPS:
        own[name] = None
    return plain(own) | groups | {"subset": settings.subset}


def _reliability(sums_3K: Any) -> list[list[float]]:
    """Points, mean probability and share occupied of each bin that has points."""
    return [[n, p / n, occupied / n] for n, p, occupied in sums_3K.T.tolist() if n]


def _curves(result: Measurement) -> dict[str, Any]:
    categories = {
        name: {"empty": empty_K.tolist(), "occupied": occupied_K.tolist()}
        for name, (empty_K, occupied_K) in result.counts.items()
    }
    return {"levels": LEVELS.tolist(), "categories": categories}


@entry_point("evaluate", check_evaluation)
def main(cfg: DictConfig) -> None:
    """Evaluate into Hydra's run folder and print where to look."""
    folder = Path(HydraConfig.get().runtime.output_dir)
    metrics = evaluate(cfg, folder)
    for name in ("iou", "iou_bbox", "iou_unrotated", "mesh_iou", "chamfer_l1", "f_score_1"):
        if f"test/{name}" in metrics:
            logger.info("test/%s %.4f", name, metrics[f"test/{name}"])
    logger.info("results, meshes and pictures are in %s", folder)


if __name__ == "__main__":
    main()
