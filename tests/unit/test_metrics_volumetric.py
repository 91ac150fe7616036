import numpy as np
import pytest
import torch
from samples import iou

from stereo_occ.metrics.volumetric import (
    best_threshold,
    category_means,
    iou_at_thresholds,
)

THRESHOLDS = torch.arange(1, 20) / 20
INF = float("inf")


def ball(points_N3, radius, center=(0.0, 0, 0)):
    return torch.tensor(np.linalg.norm(points_N3 - np.array(center), axis=1) < radius)[None]


def cube_points(count=200_000):
    return np.random.default_rng(0).uniform(-0.5, 0.5, (count, 3))


def test_concentric_balls():
    points_N3 = cube_points()
    for small, large in ((0.3, 0.4), (0.2, 0.45)):
        expected = (small / large) ** 3
        sigma = np.sqrt(expected * (1 - expected) / float(ball(points_N3, large).sum()))
        assert float(iou(ball(points_N3, small), ball(points_N3, large))) == pytest.approx(
            expected, abs=4.5 * sigma
        )


def test_shifted_boxes():
    """Boxes of length L shifted by s along it: IoU = (L - s) / (L + s)."""
    points_N3 = cube_points()
    first = torch.tensor(np.abs(points_N3[:, 0] + 0.1) < 0.3)[None]
    second = torch.tensor(np.abs(points_N3[:, 0] - 0.1) < 0.3)[None]
    assert float(iou(first, second)) == pytest.approx(0.4 / 0.8, abs=0.006)


def test_empty_unions():
    nothing, something = torch.zeros(1, 4, dtype=torch.bool), torch.tensor([[True, False, False, False]])
    assert iou(nothing, nothing).tolist() == [1]
    assert iou(nothing, something).tolist() == [0]
    assert iou(something, nothing).tolist() == [0]
    silent, loud = torch.full((1, 4), -9.0), torch.full((1, 4), 9.0)
    assert (iou_at_thresholds(silent, nothing, THRESHOLDS) == 1).all()
    assert (iou_at_thresholds(loud, nothing, THRESHOLDS) == 0).all()
    assert (iou_at_thresholds(silent, something, THRESHOLDS) == 0).all()
    assert (iou_at_thresholds(loud, something, THRESHOLDS) == 0.25).all()


def test_many_thresholds_agree_with_one_at_a_time():
    generator = torch.Generator().manual_seed(0)
    logits_BN = 3 * torch.randn(5, 400, generator=generator)
    occupied_BN = torch.rand(5, 400, generator=generator) < logits_BN.sigmoid()
    table_BT = iou_at_thresholds(logits_BN, occupied_BN, THRESHOLDS)
    for column, threshold in enumerate(THRESHOLDS):
        predicted_BN = logits_BN.double().sigmoid() >= threshold.double()
        intersection_B, union_B = (predicted_BN & occupied_BN).sum(1), (predicted_BN | occupied_BN).sum(1)
        torch.testing.assert_close(table_BT[:, column], intersection_B / union_B)


def test_a_probability_at_the_threshold_counts_as_occupied():
    occupied_BN = torch.tensor([[True]])
    half = torch.tensor([0.5])
    assert iou_at_thresholds(torch.tensor([[0.0]]), occupied_BN, half).item() == 1
    assert iou_at_thresholds(torch.tensor([[-1e-6]]), occupied_BN, half).item() == 0


def test_infinite_logits_are_certain():
    occupied_BN = torch.tensor([[True, False]])
    assert (iou_at_thresholds(torch.tensor([[INF, -INF]]), occupied_BN, THRESHOLDS) == 1).all()


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.float64])
def test_low_precision_logits(dtype):
    logits_BN = torch.tensor([[-4, -0.5, 0.5, 4]], dtype=dtype)
    occupied_BN = torch.tensor([[False, True, False, True]])
    thresholds_T = torch.tensor([0.25, 0.5, 0.9])
    torch.testing.assert_close(
        iou_at_thresholds(logits_BN, occupied_BN, thresholds_T), torch.tensor([[2 / 3, 1 / 3, 1 / 2]])
    )


def test_a_nan_fails_its_own_view_only():
    logits_BN = torch.tensor([[float("nan"), -9, -9], [9, -9, -9]])
    occupied_BN = torch.tensor([[False, False, False], [True, False, False]])
    score_BT = iou_at_thresholds(logits_BN, occupied_BN, THRESHOLDS)
    assert (score_BT[0] == 0).all()
    assert (score_BT[1] == 1).all()


@pytest.mark.parametrize("thresholds", [[0.5, 0.4], [0.0, 0.5], [0.5, 1.0], [0.5, 0.5]])
def test_thresholds_that_make_no_sense(thresholds):
    with pytest.raises(ValueError, match="increase between 0 and 1"):
        iou_at_thresholds(torch.zeros(1, 1), torch.zeros(1, 1).bool(), torch.tensor(thresholds))


def test_category_means_weigh_categories_equally():
    means = category_means(torch.tensor([0.2, 0.4, 0.6, 1.0]), ["mug", "bowl", "mug", "mug"])
    assert means == pytest.approx({"bowl": 0.4, "mug": 0.6, "macro": 0.5, "all": 0.55})
    with pytest.raises(ValueError, match="2 values for 1 categories"):
        category_means(torch.zeros(2), ["mug"])
    with pytest.raises(ValueError, match="at least one"):
        category_means(torch.zeros(0), [])


def test_best_threshold_maximises_the_macro_mean():
    """Three mugs like 0.3, one bowl likes 0.7: the plain mean would choose 0.3, the macro mean 0.7."""
    iou_VT = torch.tensor([[0.6, 0.5], [0.6, 0.5], [0.6, 0.5], [0.2, 0.5]])
    thresholds_T = torch.tensor([0.3, 0.7])
    assert best_threshold(iou_VT, ["mug", "mug", "mug", "bowl"], thresholds_T) == pytest.approx(0.7)
    assert best_threshold(iou_VT[:3], ["mug"] * 3, thresholds_T) == pytest.approx(0.3)


def test_best_threshold_of_equals_is_the_middle():
    assert best_threshold(torch.zeros(2, 19), ["mug", "bowl"], THRESHOLDS) == 0.5
