"""Folders of evaluations as small as a report takes them, without a network."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import torch
import trimesh
from samples import small_shard

from stereo_occ.data.dataset import EvaluationPairs
from stereo_occ.data.shard import Shard
from stereo_occ.kept_views import ViewKeeper
from stereo_occ.metrics.curves import LEVELS, logit_counts
from stereo_occ.predictors import ObjectView
from stereo_occ.provenance import PROTOCOL, SCHEMA

CATEGORIES = ("mug", "bowl")
OBJECTS, VIEWS = 5, 2

FACTS = {
    "schema": SCHEMA, "protocol": PROTOCOL, "commit": "0123456789abcdef", "dirty": False, "torch": "2", "cpu": "one",
    "step": 10, "parameters": 1_500_000, "control": {"name": "none", "degrees": 0.0},
    "subset": "test", "data": "somewhere/procedural_64px_abc", "objects": 10, "views": VIEWS, "points": 100,
    "split": {"hash": "a"}, "threshold": 0.5, "failures": {}, "meshes": {"views": 1, "resolution": 8, "points": 50},
    "reliability": {name: [[50, 0.1, 0.0], [50, 0.9, 1.0]] for name in CATEGORIES},
}  # fmt: skip


def hard(category: str, index: int, view: int) -> float:
    return 0.1 * index + 0.05 * view + (0.2 if category == "bowl" else 0)


def trained(model: str, seed: int, **config) -> dict:
    """As ``metrics.json`` tells of a training."""
    history = [{"step": 5, "val/iou": 0.2, "val/loss": 0.7}, {"step": 10, "val/iou": 0.3, "val/loss": 0.5}]
    return {"config": {"model": {"name": model}, "seed": seed, **config}, "history": history}


def write_views(folder: Path) -> Path:
    """The folder ``views`` of an evaluation that predicts balls: where the truth is a box with a hole."""
    keeper = ViewKeeper(folder)
    for category in CATEGORIES:
        for index in range(OBJECTS):
            path = small_shard(folder / "shards", category, f"{category}_{index}", views=VIEWS)
            shard = Shard(path)
            pair = EvaluationPairs([shard], [0], 10).batch([0], [{}]).views
            true = shard.mesh.apply_transform(shard.pose(0).rig_from_object)
            keeper.keep(ObjectView(shard, 0), pair, trimesh.creation.icosphere(3, 0.25), true)
    keeper.write_index()
    return keeper.folder


def evaluation(folder: Path, iou_of=hard, model="stereo", seed=0, views: Path | None = None, **facts) -> Path:
    """An evaluation's folder.

    Args:
        views: what :func:`write_views` wrote; None leaves it out.
    """
    folder.mkdir(parents=True)
    rows = [
        {"category": category, "object_id": f"{category}_{index}", "view": view, "failure": "",
         "iou": iou_of(category, index, view), "iou_bbox": 0.5}
        for category in CATEGORIES for index in range(OBJECTS) for view in range(VIEWS)
    ]  # fmt: skip
    with (folder / "per_object.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    macro = np.mean([np.mean([row["iou"] for row in rows if row["category"] == name]) for name in CATEGORIES])
    all_facts = FACTS | {"trained": trained(model, seed), "metrics": {"test/iou": float(macro)}}
    all_facts |= {"predictor": {"checkpoint": "best.ckpt"}} | facts
    (folder / "metrics.json").write_text(json.dumps(all_facts))
    empty_K, occupied_K = logit_counts(torch.tensor([3.0, -3.0, 1.0]), torch.tensor([True, False, False]))
    counts = {"empty": empty_K.tolist(), "occupied": occupied_K.tolist()}
    curves = {"levels": LEVELS.tolist(), "categories": dict.fromkeys(CATEGORIES, counts)}
    (folder / "curves.json").write_text(json.dumps(curves))
    if views is not None:
        shutil.copytree(views, folder / "views")
    return folder
