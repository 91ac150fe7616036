"""Every metric of every object-view, one row each: the same for networks and baselines."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm
from trimesh import Trimesh

from stereo_occ.data.batch import Batch, map_tensors
from stereo_occ.data.dataset import EvaluationPairs
from stereo_occ.data.seeds import object_seed
from stereo_occ.data.shard import Shard
from stereo_occ.metrics.curves import logit_counts
from stereo_occ.metrics.mesh import MeshScores, compare_meshes
from stereo_occ.metrics.points import point_metrics, region_metrics, reliability_sums
from stereo_occ.metrics.regions import region_points
from stereo_occ.metrics.size import size_errors
from stereo_occ.metrics.summary import METRICS
from stereo_occ.models.base import StereoViews
from stereo_occ.predictors import ObjectView, Predictor

#: Is given a view, its picture (``B = 1``), the predicted and the true mesh, both in the rig frame.
Keep = Callable[[ObjectView, StereoViews, Trimesh, Trimesh], None]


@dataclass(frozen=True)
class MeshSettings:
    """How meshes are measured: of the first ``views`` views of each object, from ``points`` on each surface."""

    views: int
    resolution: int
    points: int


@dataclass
class Measurement:
    """What :func:`measure` found.

    Attributes:
        rows: one per object-view: ``category``, ``object_id``, ``view``, ``failure`` (empty where there is none) and
            every metric of :data:`~stereo_occ.metrics.summary.METRICS`, None where it does not apply.
        thresholds: decision threshold on the probability, one per object-view.
        reliability: by category, sums of :func:`~stereo_occ.metrics.points.reliability_sums` over the cube's points.
        counts: by category, sums of :func:`~stereo_occ.metrics.curves.logit_counts` likewise.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    thresholds: list[float] = field(default_factory=list)
    reliability: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    counts: dict[str, NDArray[np.int64]] = field(default_factory=dict)


def measure(
    predictor: Predictor,
    dataset: EvaluationPairs,
    batches: Iterable[Batch],
    meshes: MeshSettings,
    progress: bool = False,
    keep: Keep | None = None,
) -> Measurement:
    """Measure a predictor on the views of ``dataset``, which ``batches`` serves in order.

    Args:
        keep: is called with the meshes of each object's first view, if they are measured.
    """
    result = Measurement()
    with tqdm(total=len(dataset), desc="evaluating", unit="view", disable=not progress) as bar:
        for batch in batches:
            first = len(result.rows)
            views = [ObjectView(*dataset.locate(first + i)) for i in range(len(batch))]
            regions = [_regions(view) for view in views]
            asked = {name: queries.points_BN3 for name, queries in batch.queries.items()} | _padded(regions)
            logits = predictor.logits(views, batch.views, asked)
            thresholds = predictor.decision.thresholds(logits["cube"]).tolist()
            result.thresholds += thresholds
            for i, (view, threshold) in enumerate(zip(views, thresholds, strict=True)):
                of_view = {name: logits_BN[i] for name, logits_BN in logits.items()}
                occupied = {name: queries.occupied_BN[i] > 0.5 for name, queries in batch.queries.items()}
                answers = {name: of_view[name][: len(points)] for name, points in regions[i].items()}
                values: dict[str, float | None] = dict.fromkeys(METRICS)
                values |= point_metrics(of_view, occupied, threshold)
                values |= region_metrics(answers, threshold)
                failures = ["NaN"] if any(x.isnan().any() for x in of_view.values()) else []
                place = (first + i) % len(dataset.views)  # among the object's views
                if place < meshes.views:
                    picture = _only(batch.views, i)
                    predicted = predictor.mesh(view, picture, meshes.resolution)
                    true = view.shard.mesh.apply_transform(view.pose.rig_from_object)
                    if keep is not None and place == 0:
                        keep(view, picture, predicted, true)
                    scores = _mesh_scores(predicted, true, view, meshes.points)
                    unit = view.shard.unit(view.view)
                    values |= scores.values
                    values |= size_errors(predicted, true, view.pose.rig_from_object, unit)
                    failures += [scores.failure] if scores.failure else []
                result.rows.append({**vars(batch.ids[i]), "failure": "; ".join(failures), **values})
                cube = of_view["cube"], occupied["cube"]
                _add(result.reliability, view.shard.category, reliability_sums(*cube))
                _add(result.counts, view.shard.category, logit_counts(*cube))
            bar.update(len(batch))
    return result


def _add(sums: dict[str, NDArray[Any]], category: str, more: NDArray[Any]) -> None:
    sums[category] = sums[category] + more if category in sums else more


def _regions(view: ObjectView) -> dict[str, NDArray[np.float64]]:
    """Points ``(N, 3)`` of the object's thin parts and cavity, rig frame."""
    return {name: view.pose.to_rig(points_N3) for name, points_N3 in _object_regions(view.shard).items()}


@lru_cache(maxsize=8)
def _object_regions(shard: Shard) -> dict[str, NDArray[np.float32]]:
    return region_points(shard.category, shard.mesh, shard.pool("box"))


def _padded(regions: Sequence[dict[str, NDArray[np.float64]]]) -> dict[str, Tensor]:
    """Each region's points of all views ``(B, N, 3)``, filled up with the cube's centre."""
    padded: dict[str, Tensor] = {}
    for name in sorted(set().union(*regions)):
        points = [region.get(name, np.empty((0, 3))) for region in regions]
        rows = [
            torch.nn.functional.pad(
                torch.from_numpy(points_N3), (0, 0, 0, max(map(len, points)) - len(points_N3))
            )
            for points_N3 in points
        ]
        padded[name] = torch.stack(rows).float()
    return padded


def _only(views: StereoViews, index: int) -> StereoViews:
    return map_tensors(views, lambda tensor: tensor[index : index + 1])


def _mesh_scores(predicted: Trimesh, true: Trimesh, view: ObjectView, points: int) -> MeshScores:
    camera_from_rig_244 = view.shard.cameras(view.view)[1]
    centers_23 = np.linalg.inv(camera_from_rig_244)[:, :3, 3].astype(np.float64)
    rng = np.random.default_rng([object_seed(view.shard.category, view.shard.object_id), view.view])
    return compare_meshes(predicted, true, centers_23, points, rng)
