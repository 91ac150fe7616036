"""Calibration of probabilities, and shares of points in thin parts and cavities."""

import numpy as np
import pytest
import torch
import trimesh

from stereo_occ.metrics.calibration import BINS, brier, expected_calibration_error, reliability
from stereo_occ.metrics.points import point_metrics, region_metrics, reliability_sums
from stereo_occ.metrics.regions import region_points
from stereo_occ.occupancy.pools import box_pool
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import Shape


def ece(probability_N, occupied_N):
    return expected_calibration_error(reliability(np.asarray(probability_N), np.asarray(occupied_N)))


def test_sure_and_right_sure_and_wrong():
    right, wrong = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    occupied = np.array([True, False])
    assert (brier(right, occupied), ece(right, occupied)) == (0, 0)
    assert (brier(wrong, occupied), ece(wrong, occupied)) == (1, 1)


def test_probabilities_that_mean_what_they_say():
    """Brier of an honest forecast is its variance; its calibration error is what chance leaves."""
    rng = np.random.default_rng(0)
    probability = rng.random(200_000)
    occupied = rng.random(200_000) < probability
    assert brier(probability, occupied) == pytest.approx(1 / 6, abs=2e-3)
    assert ece(probability, occupied) < 5e-3


def test_a_constant_forecast_is_off_by_its_distance_from_the_share():
    occupied = np.arange(1000) < 300
    assert ece(np.full(1000, 0.5), occupied) == pytest.approx(0.2)
    assert brier(np.full(1000, 0.5), occupied) == pytest.approx(0.25)


def test_sums_of_sets_add_up_and_the_last_bin_holds_certainty():
    rng = np.random.default_rng(1)
    probability, occupied = rng.random(1000), rng.random(1000) < 0.3
    whole = reliability(probability, occupied)
    assert whole == pytest.approx(
        reliability(probability[:300], occupied[:300]) + reliability(probability[300:], occupied[300:])
    )
    assert reliability(np.ones(3), np.ones(3, bool))[:, BINS - 1].tolist() == [3, 3, 3]


def queries(values):
    return dict.fromkeys(("cube", "bbox", "unposed"), torch.tensor(values))


def test_metrics_of_a_view():
    labels = queries([True, True, False, False])
    logits = queries([9.0, -9.0, -9.0, -9.0]) | {"unposed": torch.tensor([-9.0, -9.0, 9.0, 9.0])}
    values = point_metrics(logits, labels, 0.5)
    assert (values["iou"], values["iou_bbox"], values["iou_unrotated"]) == (0.5, 0.5, 0)
    assert values["brier"] == pytest.approx(0.25, abs=1e-3)
    timid = point_metrics(queries([-1.0, -1.0, -3.0, -3.0]), labels, 0.2)
    assert (timid["iou"], timid["iou_at_0.5"]) == (1, 0)


def test_a_failed_view_gets_the_worst_of_everything():
    labels, logits = queries([True, False]), queries([float("nan"), -9.0])
    values = point_metrics(logits, labels, 0.5)
    assert {values[name] for name in ("iou", "iou_bbox", "iou_unrotated", "iou_at_0.5")} == {0}
    assert {values[name] for name in ("brier", "brier_bbox", "ece", "ece_bbox")} == {1}
    assert expected_calibration_error(reliability_sums(logits["cube"], labels["cube"])) == 1
    nan = {"handle_recall": torch.tensor([float("nan"), 9.0]), "cavity_empty": torch.tensor([float("nan")])}
    assert region_metrics(nan, 0.5) == {"handle_recall": 0, "cavity_empty": 0}


@pytest.mark.parametrize(("right", "loss"), [(True, 0), (False, 100)])
def test_infinite_logits_have_a_finite_loss(right, loss):
    labels = queries([True, False] if right else [False, True])
    values = point_metrics(queries([float("inf"), -float("inf")]), labels, 0.5)
    assert values["loss"] == pytest.approx(loss, abs=1e-6)
    assert values["iou"] == values["iou_bbox"] == float(right)
    assert all(np.isfinite(value) for value in values.values())


def test_parts_are_to_be_occupied_and_cavities_empty():
    logits = torch.tensor([9.0, 9.0, 9.0, -9.0])
    values = region_metrics({"handle_recall": logits, "neck_recall": logits, "cavity_empty": logits}, 0.5)
    assert values == {"handle_recall": 0.75, "neck_recall": 0.75, "cavity_empty": 0.25}


def cup(radius=0.3, wall=0.02, height=0.5):
    outer = trimesh.creation.cylinder(radius=radius, height=height, sections=64)
    inner = trimesh.creation.cylinder(radius=radius - wall, height=height, sections=64)
    inner.apply_translation([0, 0, 0.05])
    return outer.difference(inner)


@pytest.mark.parametrize("turn", [None, [1, 2, 3]])
def test_the_cavity_of_a_cup_is_what_it_holds_however_it_lies(turn):
    """Its points are within the walls and below the rim, and fill most of what is there."""
    rotation = np.eye(4) if turn is None else trimesh.transformations.rotation_matrix(1.0, turn)
    shape = Shape("mug", "cup", cup().apply_transform(rotation))
    pool = box_pool(shape, 20_000, np.random.default_rng(0))
    cavity = region_points("mug", shape.mesh, pool)["cavity_empty"] @ rotation[:3, :3]
    assert np.hypot(cavity[:, 0], cavity[:, 1]).max() < 0.28
    assert cavity[:, 2].max() < 0.25
    assert cavity[:, 2].min() < -0.18
    looked_at = pool.points_N3[~pool.occupied_N][:4000] @ rotation[:3, :3]
    inside = (np.hypot(looked_at[:, 0], looked_at[:, 1]) < 0.28) & (np.abs(looked_at[:, 2]) < 0.2)
    assert len(cavity) > 0.8 * inside.sum()


def test_a_solid_without_a_hollow_has_no_cavity():
    shape = Shape("mug", "ball", trimesh.creation.icosphere(radius=0.4))
    assert region_points("mug", shape.mesh, box_pool(shape, 5000, np.random.default_rng(0))) == {}


@pytest.mark.parametrize(
    ("category", "regions"),
    [("mug", {"handle_recall", "cavity_empty"}), ("bowl", {"cavity_empty"}), ("bottle", {"neck_recall"})],
)
def test_regions_of_procedural_objects(category, regions):
    shape = procedural_shape(category, 0, 1)
    found = region_points(category, shape.mesh, box_pool(shape, 20_000, np.random.default_rng(0)))
    assert set(found) == regions
    if category == "mug":
        in_handle = shape.parts["handle"].contains(found["handle_recall"].astype(np.float64))
        assert in_handle.mean() > 0.99
