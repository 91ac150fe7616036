"""Auxiliary heads: what they are asked for, and that only training has them."""

import pytest
import torch
from torch import nn

from stereo_occ.auxiliary import AuxiliaryHeads, auxiliary_losses, outputs_of
from stereo_occ.data.batch import Batch, ImageTruth, ViewId
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.models.base import StereoViews


class Fixed(AuxiliaryHeads):
    """Answers what it was told."""

    def __init__(self, mask_logits_MHW, depth_MHW):
        super().__init__(4)
        self.answers = mask_logits_MHW, depth_MHW

    def forward(self, features_MCHW):
        return self.answers


def batch_of(mask_B2HW, depth_B2HW):
    count = len(mask_B2HW)
    rig = toed_in_rig(1.5, 0.2, 1.0, 8)
    extrinsics = torch.stack([torch.tensor(camera.camera_from_rig).float() for camera in rig.cameras])
    views = StereoViews(
        *torch.zeros(2, count, 3, 8, 8),
        torch.eye(3).repeat(count, 2, 1, 1),
        extrinsics.repeat(count, 1, 1, 1),
    )
    ids = [ViewId("mug", "m", index) for index in range(count)]
    return Batch(views, {}, ids, ImageTruth(mask_B2HW, depth_B2HW, views.camera_from_rig_B244[:, :, 2, 3]))


@pytest.fixture
def batch():
    """Two pairs; only the right image of the first shows something: in two cells, one of them half."""
    mask, depth = torch.zeros(2, 2, 8, 8), torch.zeros(2, 2, 8, 8)
    mask[0, 1, :4, :6] = 1
    depth[0, 1, :4, :4], depth[0, 1, :4, 4:6] = 1.4, 1.7
    return batch_of(mask, depth)


def test_the_best_answer_costs_nothing(batch):
    logits, depth = torch.full((4, 2, 2), -50.0), torch.full((4, 2, 2), 9.0)  # the background's depth is free
    logits[2, 0] = torch.tensor([50.0, 0.0])  # both left images, then both right ones
    depth[2, 0] = torch.tensor([-0.1, 0.2])
    losses = auxiliary_losses(Fixed(logits, depth), torch.zeros(4, 4, 2, 2), batch)
    torch.testing.assert_close(losses["depth"], torch.tensor(0.0), atol=1e-6, rtol=0)
    torch.testing.assert_close(losses["mask"], torch.tensor(2.0).log() / 16)  # the half cell's own entropy


def test_depth_is_the_mean_error_over_what_is_seen(batch):
    losses = auxiliary_losses(
        Fixed(torch.zeros(4, 2, 2), torch.zeros(4, 2, 2)), torch.zeros(4, 4, 2, 2), batch
    )
    torch.testing.assert_close(losses["depth"], torch.tensor((0.1 * 1 + 0.2 * 0.5) / 1.5))
    torch.testing.assert_close(losses["mask"], torch.tensor(2.0).log())


def test_maps_of_the_left_images_alone(batch):
    losses = auxiliary_losses(
        Fixed(torch.full((2, 2, 2), -50.0), torch.zeros(2, 2, 2)), torch.zeros(2, 4, 2, 2), batch
    )
    assert {name: float(value) for name, value in losses.items()} == {"mask": pytest.approx(0), "depth": 0}


def test_the_surface_that_a_model_finds_is_measured_as_the_depth_is(batch):
    wrong = torch.tensor([0.3, 0.5]).view(2, 1, 1, 1).expand(2, 2, 2, 2)  # left views and right ones
    losses = auxiliary_losses(
        Fixed(torch.zeros(4, 2, 2), torch.zeros(4, 2, 2)), torch.zeros(4, 4, 2, 2), batch, wrong
    )
    torch.testing.assert_close(losses["surface"], torch.tensor((0.6 * 1 + 0.3 * 0.5) / 1.5))


def test_heads_learn(batch):
    torch.manual_seed(0)
    heads, features = AuxiliaryHeads(4), torch.randn(4, 4, 4, 4)
    optimizer = torch.optim.Adam(heads.parameters(), lr=0.03)
    history = []
    for _ in range(60):
        losses = auxiliary_losses(heads, features, batch)
        history.append({name: value.item() for name, value in losses.items()})
        optimizer.zero_grad()
        sum(losses.values()).backward()
        optimizer.step()
    assert all(history[-1][name] < 0.4 * history[0][name] for name in ("mask", "depth"))


def test_outputs_are_kept_while_it_lasts():
    layer = nn.Linear(2, 2)
    with outputs_of(layer) as outputs:
        expected = layer(torch.ones(1, 2))
    layer(torch.zeros(1, 2))
    assert len(outputs) == 1
    assert outputs[0] is expected
