"""From which probability on a point counts as inside."""

from itertools import combinations
from math import log

import numpy as np
import pytest
import torch

from stereo_occ.data.batch import Batch, Queries, ViewId
from stereo_occ.decision import LEAST, Decision, DecisionRule, highest_expected_iou, level_shift
from stereo_occ.metrics.scores import IOU_OF, Scores
from stereo_occ.models.base import StereoViews
from stereo_occ.reconstruction import threshold_of

RELATIVE = DecisionRule.relative


def logits_of(*probabilities):
    return torch.logit(torch.tensor([probabilities], dtype=torch.float64))


def test_the_expected_iou_is_that_of_the_best_of_all_choices():
    probabilities = [0.9, 0.62, 0.5, 0.31, 0.3, 0.12, 0.02]
    expected = max(
        sum(inside) / (len(inside) + sum(probabilities) - sum(inside))
        for count in range(1, len(probabilities) + 1)
        for inside in combinations(probabilities, count)
    )
    assert float(highest_expected_iou(logits_of(*probabilities))) == pytest.approx(expected)


def test_at_a_half_the_best_points_are_inside_and_no_others():
    """The points with odds above the highest expected IoU are those that have it."""
    cube_BN = torch.randn(20, 500, generator=torch.Generator().manual_seed(0)) * 2 - 2
    thresholds_B = Decision(0.5, RELATIVE).thresholds(cube_BN)
    probability_BN = cube_BN.double().sigmoid()
    for probability_N, threshold, highest in zip(
        probability_BN, thresholds_B, highest_expected_iou(cube_BN), strict=True
    ):
        inside_N = probability_N >= threshold
        expected = probability_N[inside_N].sum() / (inside_N.sum() + probability_N[~inside_N].sum())
        assert float(expected) == pytest.approx(float(highest))
        assert float(threshold) == pytest.approx(float(highest / (1 + highest)))


def test_a_fixed_threshold_is_that_of_every_pair():
    cube_BN = torch.randn(3, 50)
    assert Decision(0.35).thresholds(cube_BN).tolist() == pytest.approx([0.35] * 3)


def test_who_knows_less_has_a_lower_threshold_and_who_knows_all_the_chosen_one():
    sure = [0.0001] * 50 + [0.9999] * 50
    half = [0.0001] * 50 + [0.5] * 50
    nothing = [0.0001] * 100
    cube_BN = torch.cat([logits_of(*row) for row in (sure, half, nothing)])
    known, middling, unknown = Decision(0.6, RELATIVE).thresholds(cube_BN).tolist()
    assert known == pytest.approx(0.6, abs=1e-3)
    assert unknown < middling < known
    assert middling == pytest.approx(
        0.5 * 1.5 / (1 + 0.5 * 1.5), abs=1e-3
    )  # odds 0.6 / 0.4 times an IoU of a half
    assert unknown == pytest.approx(LEAST * 1.5 / (1 + LEAST * 1.5))


def test_a_failed_pair_is_not_raised():
    cube_BN = torch.full((1, 4), torch.nan)
    assert level_shift(RELATIVE, cube_BN).tolist() == [0]


def test_validation_scores_each_pair_at_its_own_threshold():
    """The IoU at a candidate is that of the points that the decision with this threshold takes."""
    generator = torch.Generator().manual_seed(1)
    logits_BN = torch.randn(4, 300, generator=generator) * torch.tensor([0.5, 1, 2, 4])[:, None] - 1
    occupied_BN = (torch.rand(4, 300, generator=generator) < logits_BN.sigmoid()).float()
    empty = torch.zeros(4, 0)
    batch = Batch(
        StereoViews(empty, empty, empty, empty),
        dict.fromkeys(IOU_OF, Queries(torch.zeros(4, 300, 3), occupied_BN)),
        [ViewId("mug", "a", view) for view in range(4)],
    )
    scores = Scores(rule=RELATIVE)
    scores.update(batch, dict.fromkeys(IOU_OF, logits_BN))

    def iou(thresholds_B1):
        inside_BN, truth_BN = logits_BN.double().sigmoid() >= thresholds_B1, occupied_BN > 0.5
        return float(((inside_BN & truth_BN).sum(dim=1) / (inside_BN | truth_BN).sum(dim=1)).mean())

    for decision in (Decision(0.3, RELATIVE), Decision(0.6, RELATIVE)):
        thresholds_B = decision.thresholds(logits_BN)
        assert scores.summary(decision.threshold)["iou"] == pytest.approx(iou(thresholds_B[:, None]))
        assert scores.mean_threshold(decision) == pytest.approx(float(thresholds_B.mean()))
        assert len(set(thresholds_B.tolist())) == 4
    assert scores.iou_at_half() == pytest.approx(iou(0.5))


@pytest.mark.parametrize("sharpness", [2.0, 30.0])
def test_a_meshs_threshold_is_that_of_points_all_over_the_cube(sharpness):
    """A ball with a soft and with a sharp edge, sampled on the grid and at random."""

    def ball(points_N3):
        return sharpness * (0.3 - np.linalg.norm(points_N3, axis=1))

    decision = Decision(0.6, RELATIVE)
    points_N3 = np.random.default_rng(0).uniform(-0.5, 0.5, (100_000, 3)).astype(np.float32)
    expected = float(decision.thresholds(torch.from_numpy(ball(points_N3))[None]))
    assert threshold_of(decision, ball) == pytest.approx(expected, abs=0.01)
    assert threshold_of(Decision(0.6), ball) == 0.6
    assert log(expected / (1 - expected)) < log(0.6 / 0.4)
