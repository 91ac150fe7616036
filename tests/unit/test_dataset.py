"""Data sets: the order of a run, the points of a pair, and the labels' frame."""

from collections import Counter
from itertools import chain, pairwise

import numpy as np
import pytest
import torch
import trimesh
from samples import POOL, SIDE, small_shard
from scipy.spatial import cKDTree

from stereo_occ.config import QueriesConfig
from stereo_occ.data.batch import Batch, ViewId, map_tensors
from stereo_occ.data.controls import ControlConfig
from stereo_occ.data.dataset import DealtBatches, Draw, EvaluationPairs, ShuffledBatches, TrainingPairs
from stereo_occ.data.examples import examples
from stereo_occ.data.shard import Shard
from stereo_occ.errors import UserError
from stereo_occ.geometry.pose import Pose
from stereo_occ.metrics.scores import Scores
from stereo_occ.occupancy.contains import contains

BOX_ONLY = QueriesConfig(box=1.0, outside=0.0, surface=0.0)


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shards")
    names = [("mug", "a"), ("mug", "b"), ("bowl", "c")]
    opened = [
        Shard(small_shard(folder, category, name, seed=i, scale=0.8))
        for i, (category, name) in enumerate(names)
    ]
    yield opened
    for shard in opened:
        shard.close()


def order(items=10, batch_size=4, steps=12, seed=0, first_step=0):
    return list(ShuffledBatches(items, batch_size, steps, seed, first_step))


@pytest.mark.parametrize("first_step", [0, 1, 2, 3, 5, 11, 12])
@pytest.mark.parametrize("batch_size", [1, 4, 25])
def test_a_run_continues_with_the_batches_it_would_have_seen(first_step, batch_size):
    """Batches do not align with the permutations of 10 items; one of 25 spans three of them."""
    assert order(batch_size=batch_size, first_step=first_step) == order(batch_size=batch_size)[first_step:]


def test_longer_training_begins_with_the_same_batches():
    assert order(steps=30)[:12] == order(steps=12)


def test_every_batch_is_full_and_there_are_as_many_as_steps():
    batches = order(items=7, batch_size=4, steps=9)
    assert [len(batch) for batch in batches] == [4] * 9
    assert len(ShuffledBatches(7, 4, 9, 0)) == 9


def test_processes_share_every_batch():
    alone = order(batch_size=6)
    parts = [list(ShuffledBatches(10, 6, 12, 0, place=(rank, 3))) for rank in range(3)]
    assert [list(chain(*three)) for three in zip(*parts, strict=True)] == alone
    with pytest.raises(UserError, match="batch_size=6: must be a multiple of the 4 processes"):
        ShuffledBatches(10, 6, 12, 0, place=(0, 4))


def test_processes_that_continue_share_the_batches_that_are_left():
    parts = [list(ShuffledBatches(10, 6, 12, 0, 5, place=(rank, 2))) for rank in range(2)]
    assert [list(chain(*both)) for both in zip(*parts, strict=True)] == order(batch_size=6)[5:]


@pytest.mark.parametrize("items", [1, 3, 4, 5, 8, 11])
@pytest.mark.parametrize("processes", [1, 2, 3])
def test_evaluation_is_dealt_out_whole(items, processes):
    alone = list(DealtBatches(items, 4))
    assert list(chain(*alone)) == list(range(items))
    hands = [list(DealtBatches(items, 4, (rank, processes))) for rank in range(processes)]
    assert all(hands)
    dealt = [batch for hand in hands[: len(alone)] for batch in hand]
    assert sorted(dealt) == alone
    assert all(hand == alone[:1] for hand in hands[len(alone) :])


def test_every_permutation_visits_every_item_once_in_a_new_order():
    draws = list(chain.from_iterable(order(items=10, batch_size=4, steps=15)))
    rounds = [[draw.item for draw in draws[start : start + 10]] for start in range(0, 60, 10)]
    assert all(sorted(items) == list(range(10)) for items in rounds)
    assert all(first != second for first, second in pairwise(rounds))


def test_positions_count_on_so_that_no_points_are_drawn_twice():
    assert [draw.position for draw in chain.from_iterable(order())] == list(range(48))


def test_seeds_give_different_orders():
    assert [d.item for d in order(seed=0)[0]] != [d.item for d in order(seed=1)[0]]


def same(first: Batch, second: Batch) -> bool:
    tensors: list[list[torch.Tensor]] = [[], []]
    for batch, found in zip((first, second), tensors, strict=True):
        map_tensors(batch, lambda tensor, found=found: found.append(tensor) or tensor)
    return first.ids == second.ids and all(torch.equal(a, b) for a, b in zip(*tensors, strict=True))


def test_a_training_batch_is_a_pure_function_of_its_draws(shards):
    draws = [Draw(4, 0), Draw(0, 1), Draw(8, 2)]
    first = TrainingPairs(shards, range(3), BOX_ONLY, 64, seed=0)
    again = TrainingPairs(shards, range(3), BOX_ONLY, 64, seed=0)
    again.__getitems__([Draw(1, 7)])
    assert same(first.__getitems__(draws), again.__getitems__(draws))


def test_the_points_of_a_view_are_new_each_time_it_comes(shards):
    dataset = TrainingPairs(shards, range(3), BOX_ONLY, 64, seed=0)
    batch = dataset.__getitems__([Draw(4, 0), Draw(4, 9)])
    assert batch.ids[0] == batch.ids[1]
    assert not torch.equal(*batch.queries["train"].points_BN3)
    other_seed = TrainingPairs(shards, range(3), BOX_ONLY, 64, seed=1).__getitems__([Draw(4, 0)])
    assert not torch.equal(other_seed.queries["train"].points_BN3[0], batch.queries["train"].points_BN3[0])


def test_the_points_of_an_evaluation_are_those_of_every_earlier_one(shards):
    """The results of this repository were measured on points drawn like these."""
    batch = EvaluationPairs(shards, range(3), 4).__getitems__([4])
    assert batch.ids == [ViewId("mug", "b", 1)]
    expected = [
        [-0.3499, 0.2732, 0.0919],
        [0.3540, -0.1666, -0.0692],
        [-0.2946, 0.2245, -0.2685],
        [-0.4830, 0.3418, 0.2717],
    ]
    torch.testing.assert_close(batch.queries["cube"].points_BN3[0], torch.tensor(expected), atol=2e-4, rtol=0)


def test_items_are_the_views_of_one_object_after_another(shards):
    dataset = TrainingPairs(shards, [0, 2], BOX_ONLY, 8, seed=0)
    assert len(dataset) == 6
    ids = dataset.__getitems__([Draw(item, item) for item in range(6)]).ids
    assert [(i.category, i.object_id, i.view) for i in ids] == [
        ("mug", "a", 0), ("mug", "a", 2), ("mug", "b", 0), ("mug", "b", 2), ("bowl", "c", 0), ("bowl", "c", 2),
    ]  # fmt: skip


def test_images_and_cameras_are_those_of_the_shard(shards):
    views = TrainingPairs(shards, range(3), BOX_ONLY, 8, seed=0).__getitems__([Draw(5, 0)]).views
    left, right = shards[1].rgb(2)
    assert views.left_BCHW.shape == (1, 3, SIDE, SIDE)
    np.testing.assert_allclose(views.left_BCHW[0].permute(1, 2, 0) * 255, left, atol=1e-4)
    np.testing.assert_allclose(views.right_BCHW[0].permute(1, 2, 0) * 255, right, atol=1e-4)
    K, camera_from_rig = shards[1].cameras(2)
    np.testing.assert_allclose(views.K_B233[0], K, rtol=1e-6)
    np.testing.assert_allclose(views.camera_from_rig_B244[0], camera_from_rig, atol=1e-6)
    assert views.camera_from_rig_B244[0, 0, 0, 3] == 0  # the origin lies on the optical axis ...
    assert views.camera_from_rig_B244[0, 0, 2, 3] == 1  # ... one metre ahead


@pytest.mark.parametrize("batch_size", [1, 2, 9])
def test_shuffled_right_images_are_another_objects_whoever_is_in_the_batch(shards, batch_size):
    pairs = TrainingPairs(
        shards, range(3), BOX_ONLY, 8, seed=0, control=ControlConfig("right_shuffled"), truth=True
    )
    for start in range(0, 9, batch_size):
        batch = pairs.__getitems__([Draw(item, item) for item in range(start, min(start + batch_size, 9))])
        for place, name in enumerate(batch.ids):
            own = next(shard for shard in shards if shard.object_id == name.object_id)
            others = [shard for shard in shards if shard is not own]
            left, right = (image[place] for image in (batch.views.left_BCHW, batch.views.right_BCHW))
            source = one_of(others, right, name.view)
            np.testing.assert_allclose(left.permute(1, 2, 0) * 255, own.rgb(name.view)[0], atol=1e-4)
            np.testing.assert_allclose(batch.truth.depth_B2HW[place, 0], own.depth(name.view)[0])
            np.testing.assert_allclose(batch.truth.depth_B2HW[place, 1], source.depth(name.view)[1])
            origins = [shard.cameras(name.view)[1][i, 2, 3] for i, shard in enumerate((own, source))]
            np.testing.assert_allclose(batch.truth.origin_B2[place], origins)
            np.testing.assert_allclose(batch.views.K_B233[place], own.cameras(name.view)[0], rtol=1e-6)


def one_of(shards, image_CHW, view):
    """The only one of ``shards`` whose right image this is."""
    pixels_HWC = image_CHW.permute(1, 2, 0).mul(255).round().byte().numpy()
    (shard,) = [shard for shard in shards if (shard.rgb(view)[1] == pixels_HWC).all()]
    return shard


def test_a_single_object_has_no_other_to_take_right_images_from(shards):
    with pytest.raises(UserError, match="there is only one; use right_zeroed"):
        EvaluationPairs(shards[:1], range(3), 8, ControlConfig("right_shuffled"))


@pytest.mark.parametrize(
    ("shares", "points", "expected"),
    [
        ((1.0, 0.0, 0.0), 100, (100, 0, 0)),
        ((0.5, 0.25, 0.25), 100, (50, 25, 25)),
        ((0.0, 0.5, 0.5), 3, None),
        ((0.0, 0.5, 0.5), 511, None),
        ((0.34, 0.33, 0.33), 7, None),
    ],
)
def test_the_query_mix_has_the_asked_shares(shards, shares, points, expected):
    box, outside, surface = shares
    dataset = TrainingPairs(shards, range(3), QueriesConfig(box, outside, surface), points, seed=0)
    counts = tuple(dataset.counts[name] for name in ("box", "outside", "surface"))
    assert sum(counts) == points
    assert all(abs(count - share * points) < 1 for count, share in zip(counts, shares, strict=True))
    assert expected is None or counts == expected
    assert dataset.__getitems__([Draw(0, 0)]).queries["train"].points_BN3.shape == (1, points, 3)


def in_posed_box(shard, pose: Pose, points_N3):
    low_3, high_3 = shard.mesh.bounds
    object_N3 = pose.to_object(points_N3)
    return ((object_N3 >= low_3 - 1e-6) & (object_N3 <= high_3 + 1e-6)).all(axis=1)


def test_each_part_of_the_mix_lies_where_it_should(shards):
    shard, pose = shards[0], shards[0].pose(1)
    mixes = {"box": (1.0, 0.0, 0.0), "outside": (0.0, 1.0, 0.0), "surface": (0.0, 0.0, 1.0)}
    points, occupied = {}, {}
    for name, shares in mixes.items():
        queries = TrainingPairs(shards, range(3), QueriesConfig(*shares), 500, seed=0)
        train = queries.__getitems__([Draw(1, 0)]).queries["train"]
        points[name], occupied[name] = train.points_BN3[0].double().numpy(), train.occupied_BN[0]
    assert in_posed_box(shard, pose, points["box"]).all()
    assert not in_posed_box(shard, pose, points["outside"]).any()
    assert np.abs(points["outside"]).max() <= 0.5
    assert occupied["outside"].sum() == 0
    surface_M3, _ = trimesh.sample.sample_surface(shard.mesh, 20_000, seed=0)
    distance_N, _ = cKDTree(surface_M3).query(pose.to_object(points["surface"]))
    assert np.median(distance_N) < 0.02  # noise of 0.01 and 0.03, in turn
    assert 0.3 < occupied["surface"].float().mean() < 0.7


@pytest.mark.parametrize("queries", ["train", "bbox", "cube"])
def test_labels_are_those_of_the_posed_mesh(shards, queries):
    """Occupancy in the rig frame: the mesh turned, scaled and moved as in the picture contains the point."""
    if queries == "train":
        mixed = QueriesConfig(0.5, 0.25, 0.25)
        batch = TrainingPairs(shards, range(3), mixed, 400, 0).__getitems__([Draw(i, i) for i in range(9)])
    else:
        batch = EvaluationPairs(shards, range(3), 400).__getitems__(list(range(9)))
    for item, view in enumerate(batch.ids):
        shard = shards[item // 3]
        posed = shard.mesh.apply_transform(shard.pose(view.view).rig_from_object)
        inside_N = contains(posed, batch.queries[queries].points_BN3[item].double().numpy())
        labels_N = batch.queries[queries].occupied_BN[item].numpy() > 0.5
        assert (inside_N != labels_N).mean() <= 0.005  # points within rounding of the surface
        assert 0 < labels_N.mean() < 1


def test_unposed_points_are_the_posed_ones_taken_back(shards):
    batch = EvaluationPairs(shards, range(3), 300).__getitems__([4])
    pose = shards[1].pose(1)
    bbox, unposed = batch.queries["bbox"], batch.queries["unposed"]
    torch.testing.assert_close(unposed.occupied_BN, bbox.occupied_BN)
    np.testing.assert_allclose(
        pose.to_rig(unposed.points_BN3[0].double().numpy()), bbox.points_BN3[0], atol=1e-6
    )
    assert (unposed.points_BN3 - bbox.points_BN3).abs().max() > 0.1


def test_evaluation_points_are_the_same_in_every_run_and_batch(shards):
    together = EvaluationPairs(shards, range(3), 100).__getitems__([0, 5])
    alone = EvaluationPairs(shards[1:], [2], 100).__getitems__([0])
    for name, queries in alone.queries.items():
        assert torch.equal(queries.points_BN3[0], together.queries[name].points_BN3[1])
    assert not torch.equal(*together.queries["bbox"].points_BN3)


def test_cube_points_fill_the_cube(shards):
    points_BN3 = EvaluationPairs(shards, range(3), POOL).__getitems__([0, 3]).queries["cube"].points_BN3
    assert points_BN3.abs().max() <= 0.5
    octant_BN = ((points_BN3 > 0).long() * torch.tensor([1, 2, 4])).sum(-1)
    counts = Counter(octant_BN.flatten().tolist())
    sigma = np.sqrt(2 * POOL / 8 * 7 / 8)
    assert all(abs(counts[octant] - 2 * POOL / 8) < 4 * sigma for octant in range(8))


def truth(shards, batch, frame):
    """Logits of a model that knows the true occupancy, in the rig frame or, wrongly, in the object frame."""
    logits = {}
    for name, queries in batch.queries.items():
        rows = []
        for view, points_N3 in zip(batch.ids, queries.points_BN3.double().numpy(), strict=True):
            shard = next(s for s in shards if s.object_id == view.object_id)
            pose = shard.pose(view.view)
            inside_N = contains(shard.mesh, pose.to_object(points_N3) if frame == "rig" else points_N3)
            rows.append(torch.where(torch.from_numpy(inside_N), 9.0, -9.0))
        logits[name] = torch.stack(rows)
    return logits


def scores_of(shards, frame):
    batch = EvaluationPairs(shards, range(3), POOL).__getitems__(list(range(9)))
    scores = Scores()
    scores.update(batch, truth(shards, batch, frame))
    return scores.summary(0.5)


def test_the_true_occupancy_scores_one_for_any_rotation(shards):
    summary = scores_of(shards, "rig")
    assert summary["iou"] == pytest.approx(1, abs=0.005)
    assert summary["iou_bbox"] == pytest.approx(1, abs=0.005)
    assert (
        summary["iou_unrotated"] < 0.6
    )  # a perfect pose-aware answer fails on points left in the object frame


def test_unrotated_points_reward_an_answer_that_ignores_the_pose(shards):
    summary = scores_of(shards, "object")
    assert summary["iou_unrotated"] == pytest.approx(1, abs=0.005)
    assert summary["iou"] < 0.6
    assert summary["iou_bbox"] < 0.9  # high all the same: these solids fill their boxes


def test_more_points_than_the_pool_has(shards):
    with pytest.raises(UserError, match=rf"{POOL + 1} asked from a pool of {POOL}"):
        EvaluationPairs(shards, range(3), POOL + 1).__getitems__([0])


def test_examples_are_the_first_view_of_the_first_objects_of_each_category(shards):
    shown = list(examples(EvaluationPairs(shards, [1, 2], 50), count=1))
    assert [(e.id.category, e.id.object_id, e.id.view) for e in shown] == [("mug", "a", 1), ("bowl", "c", 1)]
    bbox = shown[0].batch.queries["bbox"]
    inside_N = contains(shown[0].true, bbox.points_BN3[0].double().numpy())
    assert (inside_N == (bbox.occupied_BN[0].numpy() > 0.5)).mean() > 0.97
    assert len(list(examples(EvaluationPairs(shards, [1], 50), count=5))) == 3
    assert list(examples(EvaluationPairs(shards, [1], 50), count=0)) == []
