"""Controls: what each takes from the pair, and that it leaves the rest."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from rigs import random_pairs
from scipy.spatial.transform import Rotation

from stereo_occ.data.batch import Batch, Queries, ViewId
from stereo_occ.data.controls import CONTROLS, ControlConfig, axes_of, controlled, right_item


def batch_of(count, seed=0):
    points = torch.rand(count, 5, 3, generator=torch.Generator().manual_seed(seed))
    ids = [ViewId("mug", f"mug_{index}", index % 2) for index in range(count)]
    return Batch(random_pairs(count, seed), {"train": Queries(points, points[..., 0].round())}, ids)


def seen(name, batch, degrees=0.0):
    return controlled(ControlConfig(name, degrees), batch)


def changed(before, after):
    """The fields of the views that a control has changed."""
    return {
        name for name, value in vars(before.views).items() if not torch.equal(value, vars(after.views)[name])
    }


def centers(views):
    extrinsics = views.camera_from_rig_B244
    return -(extrinsics[..., :3, :3].mT @ extrinsics[..., :3, 3:])[..., 0]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("none", set()),
        ("right_zeroed", {"right_BCHW"}),
        ("left_twice", {"right_BCHW", "K_B233", "camera_from_rig_B244"}),
        ("calibration_off", {"camera_from_rig_B244"}),
    ],
)
def test_what_a_control_changes(name, expected):
    batch = batch_of(4)
    before = {field: value.clone() for field, value in vars(batch.views).items()}
    after = seen(name, batch, degrees=1.0)
    assert changed(batch, after) == expected
    assert (after.queries, after.ids) == (batch.queries, batch.ids)
    assert all(torch.equal(value, before[field]) for field, value in vars(batch.views).items())
    again = seen(name, batch, degrees=1.0)
    assert changed(after, again) == set()


def test_every_control_is_tested():
    """right_shuffled needs a data set: tests/unit/test_dataset.py."""
    assert set(CONTROLS) == {"none", "right_zeroed", "left_twice", "right_shuffled", "calibration_off"}
    assert ControlConfig() == ControlConfig("none", 0.0)


def test_a_zeroed_right_image_is_black():
    assert seen("right_zeroed", batch_of(2)).views.right_BCHW.abs().max() == 0


def test_the_left_view_twice_is_two_equal_views():
    views = seen("left_twice", batch_of(3)).views
    assert torch.equal(views.right_BCHW, views.left_BCHW)
    assert torch.equal(views.K_B233[:, 1], views.K_B233[:, 0])
    assert torch.equal(views.camera_from_rig_B244[:, 1], views.camera_from_rig_B244[:, 0])


def test_the_partner_of_an_item_is_another_object_seen_from_the_same_view():
    objects, views = 5, 4
    shuffled = ControlConfig("right_shuffled")
    partners = np.array([right_item(shuffled, item, objects, views) for item in range(objects * views)])
    assert (partners // views != np.arange(objects * views) // views).all()
    assert (partners % views == np.arange(objects * views) % views).all()
    assert [right_item(ControlConfig(), item, objects, views) for item in range(3)] == [0, 1, 2]


def test_every_other_object_is_as_likely_a_partner():
    objects, views = 4, 3000
    partners = [right_item(ControlConfig("right_shuffled"), item, objects, views) for item in range(views)]
    shares = np.bincount(np.array(partners) // views, minlength=objects) / views
    np.testing.assert_allclose(shares, [0, 1 / 3, 1 / 3, 1 / 3], atol=0.03)


@pytest.mark.parametrize("degrees", [0.5, 2.0, 90.0])
def test_a_camera_that_is_off_is_turned_about_its_centre(degrees):
    batch = batch_of(8)
    off = seen("calibration_off", batch, degrees).views
    torch.testing.assert_close(centers(off), centers(batch.views))
    turns = off.camera_from_rig_B244[:, :, :3, :3] @ batch.views.camera_from_rig_B244[:, :, :3, :3].mT
    vectors = Rotation.from_matrix(turns[:, 1].double().numpy()).as_rotvec(degrees=True)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), degrees, rtol=1e-3)
    np.testing.assert_allclose(vectors / degrees, axes_of(batch.ids), atol=2e-3)
    assert torch.equal(off.camera_from_rig_B244[:, 0], batch.views.camera_from_rig_B244[:, 0])


def test_a_view_is_off_in_the_same_way_in_every_batch():
    batch = batch_of(5)
    order = [3, 1, 4]
    part = Batch(
        replace(batch.views, **{name: value[order] for name, value in vars(batch.views).items()}),
        {},
        [batch.ids[index] for index in order],
    )
    whole, alone = (seen("calibration_off", some, 1.0).views.camera_from_rig_B244 for some in (batch, part))
    assert torch.equal(whole[order], alone)


def test_axes_point_everywhere():
    axes = axes_of([ViewId("bowl", f"bowl_{index}", view) for index in range(400) for view in range(5)])
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1)
    np.testing.assert_allclose(axes.mean(axis=0), 0, atol=0.05)
    np.testing.assert_allclose(axes.T @ axes / len(axes), np.eye(3) / 3, atol=0.03)
