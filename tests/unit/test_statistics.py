"""The paired bootstrap: known answers, coverage, what clusters do to intervals."""

import numpy as np
import pytest

from stereo_occ.metrics.statistics import paired_bootstrap
from stereo_occ.metrics.summary import summarise


def views(objects, per_object, category="mug"):
    """Categories and names of ``per_object`` views of each object."""
    names = [f"{category}_{index}" for index in range(objects) for _ in range(per_object)]
    return [category] * len(names), names


def test_a_constant_difference_has_an_interval_of_no_width():
    categories, objects = views(10, 4)
    b = np.random.default_rng(0).random((1, 40))
    result = paired_bootstrap(b + 0.25, b, categories, objects, draws=500)
    for row in (result["mug"], result["macro"]):
        assert (row.difference, row.low, row.high) == pytest.approx((0.25, 0.25, 0.25))
        assert row.clear
    assert result["mug"].objects == 10


def test_the_difference_is_a_minus_b_and_macro_the_mean_of_categories():
    categories = ["mug"] * 4 + ["bowl"] * 2
    objects = ["a", "a", "b", "b", "c", "d"]
    a = np.array([[1.0, 1.0, 0.0, 0.0, 0.5, 0.5]])
    result = paired_bootstrap(a, np.zeros((1, 6)), categories, objects, draws=200)
    assert (result["mug"].difference, result["bowl"].difference) == (0.5, 0.5)
    swapped = paired_bootstrap(np.zeros((1, 6)), a, categories, objects, draws=200)
    assert swapped["mug"].difference == -0.5
    assert result["macro"].difference == 0.5
    assert result["macro"].objects == 4
    assert (result["mug"].low, result["mug"].high) == (0, 1)  # both objects drawn twice


def test_every_view_counts_alike_where_objects_have_different_numbers_of_them():
    a = np.array([[0.8, 0.6, 0.7, 0.1]])
    row = paired_bootstrap(a, np.zeros((1, 4)), ["mug"] * 4, ["a", "a", "a", "b"], draws=400)["mug"]
    assert row.difference == pytest.approx(2.2 / 4)
    assert (row.low, row.high) == pytest.approx((0.1, 0.7))  # one object drawn twice


@pytest.mark.parametrize("per_object", [1, 5])
def test_an_interval_covers_the_truth_as_often_as_it_says(per_object):
    """Whole objects share an effect, so views of one say little more than one view does."""
    rng = np.random.default_rng(7)
    categories, objects = views(40, per_object)
    covered = []
    for trial in range(300):
        of_object = np.repeat(rng.normal(0.1, 0.2, 40), per_object)
        difference = of_object + rng.normal(0, 0.05, len(of_object))
        hardness = np.repeat(rng.random(40), per_object)  # shared by both, cancels
        row = paired_bootstrap(
            (hardness + difference)[None], hardness[None], categories, objects, draws=400, seed=trial
        )["mug"]
        covered.append(row.low <= 0.1 <= row.high)
    assert np.mean(covered) == pytest.approx(0.94, abs=0.035)


def test_views_of_one_object_are_no_new_evidence():
    """Ten copies of every view leave the interval as it is."""
    rng = np.random.default_rng(3)
    values = rng.normal(0, 1, 30)
    once = paired_bootstrap(values[None], np.zeros((1, 30)), *views(30, 1), draws=4000)["mug"]
    copied = np.repeat(values, 10)[None]
    tenfold = paired_bootstrap(copied, np.zeros((1, 300)), *views(30, 10), draws=4000)["mug"]
    assert (tenfold.low, tenfold.high) == pytest.approx((once.low, once.high))


def test_seeds_that_disagree_widen_the_interval():
    rng = np.random.default_rng(5)
    b = rng.random((1, 60))
    steady, shaky = b + np.full((3, 1), 0.1), b + np.array([[-0.1], [0.1], [0.3]])
    of_steady = paired_bootstrap(steady, b, *views(60, 1), draws=2000)["mug"]
    of_shaky = paired_bootstrap(shaky, b, *views(60, 1), draws=2000)["mug"]
    assert of_steady.difference == pytest.approx(of_shaky.difference) == pytest.approx(0.1)
    assert of_steady.clear
    assert not of_shaky.clear


def test_the_same_seed_gives_the_same_interval():
    values = np.random.default_rng(0).normal(size=(2, 20))
    first, second, other = (
        paired_bootstrap(values, -values, *views(20, 1), draws=300, seed=seed)["macro"] for seed in (1, 1, 2)
    )
    assert first == second
    assert first.low != other.low


def test_one_object_has_no_interval():
    result = paired_bootstrap(
        np.ones((1, 3)), np.zeros((1, 3)), ["mug", "mug", "bowl"], ["a", "b", "c"], draws=50
    )
    assert (result["bowl"].low, result["bowl"].high, result["bowl"].clear) == (None, None, False)
    assert result["mug"].low is not None
    assert result["macro"].low is None


def test_summary_leaves_out_what_does_not_apply_and_nothing_else():
    rows = [
        {"category": "mug", "iou": 0.5, "handle_recall": 0.5, "chamfer_l1": None},
        {"category": "mug", "iou": 0.0, "handle_recall": 0.0, "chamfer_l1": 0.2},
        {"category": "bowl", "iou": 1.0, "handle_recall": None, "chamfer_l1": 0.4},
    ]
    values = summarise(rows)
    assert (values["iou/mug"], values["iou/bowl"], values["iou"]) == (0.25, 1.0, 0.625)
    assert values["iou/all"] == pytest.approx(0.5)
    assert values["handle_recall"] == values["handle_recall/mug"] == 0.25
    assert "handle_recall/bowl" not in values
    assert values["chamfer_l1"] == pytest.approx(0.3)
    assert "mesh_iou" not in values
