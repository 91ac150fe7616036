"""From a configuration to a baseline."""

from collections.abc import Callable
from importlib.util import find_spec

import torch

from stereo_occ.baselines.base import Baseline
from stereo_occ.baselines.config import (
    BaselineConfig,
    MeanShapeConfig,
    NearestShapeConfig,
    SemiGlobalMatchingConfig,
    TruthConfig,
)
from stereo_occ.baselines.mean_shape import MeanShape, mean_occupancy
from stereo_occ.baselines.nearest_shape import NearestShape
from stereo_occ.baselines.posed_shape import TrueShape
from stereo_occ.baselines.visual_hull import VisualHull
from stereo_occ.data.dataset import EvaluationPairs
from stereo_occ.decision import Decision
from stereo_occ.errors import UserError
from stereo_occ.metrics.scores import Scores
from stereo_occ.predictors import ObjectView

#: Candidate thresholds of the mean shape: its probabilities are low everywhere.
MEAN_THRESHOLDS = torch.linspace(0.005, 0.5, 100)


def build_baseline(
    config: BaselineConfig, training: Callable[[str], EvaluationPairs], progress: bool = False
) -> Baseline:
    """The baseline, made from training objects where it needs any.

    Args:
        training: pairs of ``train`` or ``val``; asked only by baselines that need them.

    Raises:
        UserError: OpenCV is needed and not installed.
    """
    if isinstance(config, SemiGlobalMatchingConfig):
        if find_spec("cv2") is None:
            raise UserError("baseline=sgm: needs OpenCV; pip install 'stereo-occ[sgm]'")
        from stereo_occ.baselines.semi_global_matching import SemiGlobalMatching  # OpenCV is optional

        return SemiGlobalMatching(config)
    if isinstance(config, NearestShapeConfig):
        return NearestShape(training("train").shards, config.cells, progress)
    if isinstance(config, MeanShapeConfig):
        return _mean_shape(config, training("train"), training("val"))
    return TrueShape() if isinstance(config, TruthConfig) else VisualHull()


def _mean_shape(config: MeanShapeConfig, train: EvaluationPairs, val: EvaluationPairs) -> MeanShape:
    """The mean over the first poses of the training objects; its threshold is the best on validation objects."""
    views = train.views[: config.views]
    occupancy = mean_occupancy((ObjectView(shard, v) for shard in train.shards for v in views), config.cells)
    shape = MeanShape(occupancy)
    scores = Scores(MEAN_THRESHOLDS)
    for item in range(len(val)):
        batch = val.__getitems__([item])
        points = {name: queries.points_BN3 for name, queries in batch.queries.items()}
        scores.update(batch, shape.logits([ObjectView(*val.locate(item))], batch.views, points))
    shape.decision = Decision(scores.best_threshold())
    return shape
