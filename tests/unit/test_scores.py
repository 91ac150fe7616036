"""IoU of object-views gathered from batches."""

import numpy as np
import pytest
import torch

from stereo_occ.data.batch import Batch, Queries, ViewId
from stereo_occ.metrics.scores import IOU_OF, THRESHOLDS, Scores
from stereo_occ.models.base import StereoViews

CERTAIN = 9.0


def batch_of(*views, occupied=(1.0, 1.0, 0.0, 0.0)):
    """Views ``(category, object, number)`` with four points each, the same labels everywhere."""
    empty = torch.zeros(len(views), 0)
    queries = Queries(torch.zeros(len(views), 4, 3), torch.tensor([occupied] * len(views)))
    return Batch(
        StereoViews(empty, empty, empty, empty),
        dict.fromkeys(IOU_OF, queries),
        [ViewId(*view) for view in views],
    )


def logits(*rows):
    return dict.fromkeys(IOU_OF, CERTAIN * (2 * torch.tensor(rows, dtype=torch.float32) - 1))


RIGHT, HALF, WRONG = (1, 1, 0, 0), (1, 0, 0, 0), (0, 0, 1, 1)  # IoU 1, 1/2, 0


def test_per_view_then_per_category_then_over_categories():
    scores = Scores()
    scores.update(batch_of(("mug", "a", 0), ("mug", "a", 1)), logits(RIGHT, RIGHT))
    scores.update(batch_of(("mug", "b", 0), ("bowl", "c", 0)), logits(HALF, WRONG))
    summary = scores.summary(0.5)
    assert summary["iou/mug"] == pytest.approx((1 + 1 + 0.5) / 3)
    assert summary["iou/bowl"] == 0
    assert summary["iou"] == pytest.approx(summary["iou/mug"] / 2)
    assert summary["iou/all"] == pytest.approx(2.5 / 4)


def test_each_metric_has_its_own_points():
    scores = Scores()
    mixed = {"cube": RIGHT, "bbox": HALF, "unposed": WRONG}
    scores.update(
        batch_of(("mug", "a", 0)),
        {name: CERTAIN * (2 * torch.tensor([row]).float() - 1) for name, row in mixed.items()},
    )
    summary = scores.summary(0.5)
    assert (summary["iou"], summary["iou_bbox"], summary["iou_unrotated"]) == (1, 0.5, 0)


def test_views_count_alike_whatever_batch_they_came_in():
    scores = Scores()
    scores.update(batch_of(("mug", "b", 0), ("bowl", "a", 0)), logits(RIGHT, WRONG))
    scores.update(batch_of(("mug", "a", 0), ("mug", "b", 1)), logits(HALF, WRONG))
    assert scores.summary(0.5)["iou/mug"] == pytest.approx(0.5)


def test_other_candidate_thresholds():
    scores = Scores(torch.tensor([0.01, 0.02, 0.03]))
    probability = torch.tensor([[0.025, 0.025, 0.015, 0.015]])
    scores.update(batch_of(("mug", "a", 0)), dict.fromkeys(IOU_OF, torch.logit(probability)))
    assert scores.best_threshold() == pytest.approx(0.02)


def test_the_threshold_that_suits_a_timid_model():
    """Probability 0.3 inside and 0.1 outside: thresholds between separate them, 0.5 predicts nothing."""
    scores = Scores()
    probability = torch.tensor([[0.3, 0.3, 0.1, 0.1]])
    scores.update(batch_of(("mug", "a", 0)), dict.fromkeys(IOU_OF, torch.logit(probability)))
    assert scores.best_threshold() == pytest.approx(0.3, abs=0.051)
    assert scores.summary(scores.best_threshold())["iou"] == 1
    assert scores.summary(0.5)["iou"] == 0


def test_the_threshold_is_chosen_by_the_iou_in_the_cube():
    scores = Scores()
    low, high = torch.tensor([[0.3, 0.3, 0.1, 0.1]]), torch.tensor([[0.9, 0.9, 0.7, 0.7]])
    probabilities = {"cube": high, "bbox": low, "unposed": low}
    scores.update(batch_of(("mug", "a", 0)), {name: torch.logit(p) for name, p in probabilities.items()})
    assert 0.7 < scores.best_threshold() <= 0.9
    assert scores.summary(scores.best_threshold())["iou"] == 1


def test_every_candidate_threshold_survives_storage_as_a_float():
    """A threshold is looked up by value after it went through a float32 buffer of a checkpoint."""
    probability = torch.linspace(0.01, 0.99, 400)[None]
    occupied = (torch.arange(400) >= 200).float()
    batch = batch_of(("mug", "a", 0))
    queries = Queries(torch.zeros(1, 400, 3), occupied[None])
    scores = Scores()
    scores.update(
        Batch(batch.views, dict.fromkeys(IOU_OF, queries), batch.ids),
        dict.fromkeys(IOU_OF, torch.logit(probability)),
    )
    ious = [scores.summary(float(torch.tensor(t).float()))["iou"] for t in THRESHOLDS.tolist()]
    assert len(set(ious)) == len(THRESHOLDS)


def test_a_failed_view_counts_as_zero():
    scores = Scores()
    rows = logits(RIGHT, RIGHT)
    broken = {name: values.clone() for name, values in rows.items()}
    broken["cube"][1, 0] = float("nan")
    scores.update(batch_of(("mug", "a", 0), ("mug", "b", 0)), broken)
    assert scores.summary(0.5)["iou"] == 0.5
    assert scores.summary(0.5)["iou_bbox"] == 1


def test_summary_keys_are_those_of_the_protocol():
    scores = Scores()
    scores.update(batch_of(("mug", "a", 0), ("bowl", "b", 0)), logits(RIGHT, RIGHT))
    parts = ("", "/mug", "/bowl", "/all")
    assert set(scores.summary(0.5)) == {metric + part for metric in IOU_OF.values() for part in parts}


def test_what_processes_measured_apart_is_what_one_would_have_measured():
    batches = [
        (batch_of(("mug", "a", 0), ("bowl", "c", 0)), logits(RIGHT, HALF)),
        (batch_of(("mug", "b", 0), ("bowl", "d", 0)), logits(WRONG, WRONG)),
    ]
    alone, parts = Scores(), [Scores(), Scores()]
    for part, (batch, answers) in zip(parts, batches, strict=True):
        alone.update(batch, answers)
        part.update(batch, answers)
    parts[0].merge(parts[1:])
    assert parts[0].summary(0.5) == alone.summary(0.5)
    assert parts[0].loss() == pytest.approx(alone.loss())
    assert parts[0].iou_at_half() == alone.iou_at_half() == pytest.approx(0.375)


def test_the_loss_is_the_cross_entropy_in_the_box_over_views():
    scores = Scores()
    probability = torch.tensor([[0.9, 0.8, 0.2, 0.3]])
    answers = {name: torch.zeros(1, 4) for name in IOU_OF} | {"bbox": torch.logit(probability)}
    scores.update(batch_of(("mug", "a", 0)), answers)
    assert scores.loss() == pytest.approx(-np.log([0.9, 0.8, 0.8, 0.7]).mean(), rel=1e-5)
