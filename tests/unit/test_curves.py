"""Precision-recall curves from counts: known answers."""

import numpy as np
import pytest
import torch

from stereo_occ.metrics.curves import LEVELS, average_precision, logit_counts, precision_recall_curve


def counts(logits, occupied):
    return logit_counts(torch.tensor(logits, dtype=torch.float32), torch.tensor(occupied))


def test_points_lie_between_levels_and_on_a_level_above_it():
    level = LEVELS[64]
    assert level == 0
    empty_K, occupied_K = counts([-100.0, -0.01, 0.0, 0.01, 100.0], [False, True, True, True, False])
    assert (empty_K[0], empty_K[-1], empty_K.sum()) == (1, 1, 2)
    assert (occupied_K[64], occupied_K[65], occupied_K.sum()) == (1, 2, 3)


def test_by_hand():
    """Above 1: one of two is occupied; above 0: two of three; all: two of four."""
    precision_K, recall_K = precision_recall_curve(counts([2.0, 2.0, 0.5, -3.0], [True, False, True, False]))
    at = {level: index + 1 for index, level in enumerate(LEVELS)}
    assert (precision_K[0], recall_K[0]) == (0.5, 1)
    assert (precision_K[at[0]], recall_K[at[0]]) == pytest.approx((2 / 3, 1))
    assert (precision_K[at[1]], recall_K[at[1]]) == (0.5, 0.5)
    assert np.isnan(precision_K[at[3]])
    assert recall_K[at[3]] == 0


def test_average_precision_of_answers_that_are_known():
    truth = [True] * 3 + [False] * 9
    assert average_precision(counts([4.0] * 3 + [-4.0] * 9, truth)) == 1
    assert average_precision(counts([1.5] * 12, truth)) == pytest.approx(3 / 12)
    assert average_precision(counts([-4.0] * 3 + [4.0] * 9, truth)) == pytest.approx(3 / 12)
    # Sorted by logit: occupied, empty, occupied, empty.
    by_hand = (1 / 1 + 2 / 3) / 2
    assert average_precision(counts([4.0, 3.0, 2.0, 1.0], [True, False, True, False])) == pytest.approx(
        by_hand
    )
    assert np.isnan(average_precision(counts([1.0], [False])))


def test_counts_of_two_views_are_those_of_their_points_together():
    rng = torch.Generator().manual_seed(0)
    logits, occupied = (
        3 * torch.randn(2, 400, generator=rng),
        torch.rand(2, 400, generator=rng) < 0.3,
    )
    together = logit_counts(logits.flatten(), occupied.flatten())
    assert (together == sum(map(logit_counts, logits, occupied))).all()
    precision_K, recall_K = precision_recall_curve(together)
    for level, precision, recall in zip(LEVELS[32:96], precision_K[33:97], recall_K[33:97], strict=True):
        predicted = logits > level
        hits = float((predicted & occupied).sum())
        assert precision == pytest.approx(hits / float(predicted.sum()))
        assert recall == pytest.approx(hits / float(occupied.sum()))


def test_recall_is_of_nothing_where_nothing_is_occupied():
    precision_K, recall_K = precision_recall_curve(counts([2.0, -2.0], [False, False]))
    assert np.isnan(recall_K).all()
    assert precision_K[0] == 0


def test_a_failed_view_is_sure_and_wrong():
    empty_K, occupied_K = counts([np.nan, 5.0, -5.0], [True, True, False])
    assert (occupied_K[0], empty_K[-1]) == (2, 1)
