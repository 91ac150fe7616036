"""Both calibrated stereo models: what they may depend on, and what they must."""

from dataclasses import replace

import pytest
import torch
from rigs import random_pairs, swapped
from torch.nn.functional import binary_cross_entropy_with_logits

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.models import pixel_stereo
from stereo_occ.models.build import build_model
from stereo_occ.models.light import LightEncoder
from stereo_occ.models.pixel_stereo import PixelStereoModel
from stereo_occ.models.point_decoder import PointDecoder

ENCODER = {"name": "light", "channels": 8, "widths": [8, 8, 16, 16], "blocks": [1, 1, 1, 1]}
PIXEL = {
    "name": "pixel_stereo",
    "feature_stride": 4,
    "views": "both",
    "groups": 4,
    "frequencies": 3,
    "code_size": 16,
    "hidden": 16,
    "blocks": 2,
    "encoder": ENCODER,
}
SWEEP = PIXEL | {"name": "plane_sweep_stereo", "grid": 8, "widths": [8, 16]}

AROUND_OBJECT = SWEEP | {"around": "object"}
GUIDED = AROUND_OBJECT | {"surface_channels": 4}


def build(config, **settings):
    """A model with nothing left at zero and running statistics of its own, in eval mode."""
    torch.manual_seed(0)
    model = build_model(config | settings, toed_in_rig(1.0, 0.2, 1.0, 64))
    for parameter in model.parameters():
        if not parameter.any():
            torch.nn.init.normal_(parameter, std=0.1)
    for seed in (10, 11, 12):
        model(random_pairs(4, seed), some_points(4))
    return model.eval()


def some_points(batch, count=200, seed=0):
    return torch.rand(batch, count, 3, generator=torch.Generator().manual_seed(seed)) - 0.5


@pytest.fixture(
    params=[PIXEL, SWEEP, AROUND_OBJECT, GUIDED], ids=["pixel", "sweep", "around object", "guided"]
)
def config(request):
    return request.param


@pytest.fixture
def model(config):
    return build(config)


@pytest.fixture(autouse=True)
def _no_gradients(request):
    with torch.set_grad_enabled("training" in request.node.name):
        yield


def test_left_and_right_may_change_places_with_their_cameras(model):
    views, points = random_pairs(3), some_points(3)
    expected = model(views, points)
    assert expected.std() > 0.01
    torch.testing.assert_close(model(swapped(views), points), expected, atol=1e-5, rtol=1e-5)
    only_images = replace(views, left_BCHW=views.right_BCHW, right_BCHW=views.left_BCHW)
    assert (model(only_images, points) - expected).abs().max() > 1e-3


def test_each_answer_is_of_its_own_point_and_sample(model, monkeypatch):
    views, points = random_pairs(3), some_points(3)
    expected = model(views, points)
    code = model.encode(views)
    torch.testing.assert_close(model.decode(code, points[:, 7:12]), expected[:, 7:12], atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(model.decode(code, points.flip(1)).flip(1), expected, atol=1e-5, rtol=1e-5)
    monkeypatch.setattr(pixel_stereo, "SAMPLES", 90)  # 30 points of 3 samples at once
    torch.testing.assert_close(model.decode(code, points), expected, atol=1e-5, rtol=1e-5)
    fields = {name: value[1:2] for name, value in vars(views).items()}
    torch.testing.assert_close(
        model(replace(views, **fields), points[1:2]), expected[1:2], atol=1e-5, rtol=1e-5
    )


@pytest.mark.parametrize("view", [0, 1])
def test_each_camera_matters(model, view):
    views, points = random_pairs(3), some_points(3)
    expected = model(views, points)
    extrinsics, K = views.camera_from_rig_B244.clone(), views.K_B233.clone()
    extrinsics[:, view, 0, 3] += 0.02
    K[:, view, :2, :2] *= 1.05
    for changed in (replace(views, camera_from_rig_B244=extrinsics), replace(views, K_B233=K)):
        assert (model(changed, points) - expected).abs().max() > 1e-4


def test_moving_the_rig_frame_does_not_move_what_is_seen(model):
    """With the frame-dependent parts of the token hidden, only the cameras' frames are left."""
    views, points = random_pairs(2), some_points(2)
    offset = torch.tensor([0.1, -0.05, 0.07])
    moved = views.camera_from_rig_B244.clone()
    moved[..., :3, 3] += moved[..., :3, :3] @ offset
    code, moved_code = (
        PixelStereoModel.encode(model, v) for v in (views, replace(views, camera_from_rig_B244=moved))
    )
    seen, moved_seen = code.maps.project(points), moved_code.maps.project(points - offset)
    torch.testing.assert_close(moved_seen.positions_VBN2, seen.positions_VBN2, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(moved_seen.depths_VBN, seen.depths_VBN)


def test_the_twin_of_one_view_has_the_same_parameters_and_ignores_the_right_view(config):
    twin, pair = build(config, views="left"), build(config)
    assert {n: p.shape for n, p in twin.named_parameters()} == {
        n: p.shape for n, p in pair.named_parameters()
    }
    views, points = random_pairs(3), some_points(3)
    alike, unlike = (
        replace(
            views,
            right_BCHW=other.right_BCHW,
            K_B233=torch.stack([views.K_B233[:, 0], other.K_B233[:, 1]], dim=1),
            camera_from_rig_B244=torch.stack(
                [views.camera_from_rig_B244[:, 0], other.camera_from_rig_B244[:, 1]], dim=1
            ),
        )
        for other in (views, random_pairs(3, seed=1))
    )
    assert torch.equal(twin(alike, points), twin(unlike, points))
    assert (pair(views, points) - pair(unlike, points)).abs().max() > 1e-3


def test_the_left_view_alone_is_the_pair_whose_right_camera_looks_away(config):
    twin, pair = build(config, views="left"), build(config)
    twin.load_state_dict(pair.state_dict())
    views, points = random_pairs(3), some_points(3)
    away = views.camera_from_rig_B244.clone()
    away[:, 1, 2] *= -1  # everything behind the right camera
    pair_code = pair.encode(replace(views, camera_from_rig_B244=away))
    twin_code = twin.encode(views)
    evidence = [
        m.evidence(c.maps.features_VBCHW, c.maps.project(points))
        for m, c in ((twin, twin_code), (pair, pair_code))
    ]
    torch.testing.assert_close(*evidence)


def test_answers_under_autocast_are_float32_and_close(model):
    views, points = random_pairs(3), some_points(3)
    expected = model(views, points)
    with torch.autocast("cpu", torch.bfloat16):
        logits = model(views, points)
    assert logits.dtype == torch.float32
    assert (logits - expected).abs().max() < 0.1 * expected.abs().max()


@pytest.mark.parametrize("views", ["both", "left"])
@pytest.mark.parametrize("stride", [2, 4])
def test_training_reaches_every_parameter(config, views, stride):
    model = build(config, views=views, feature_stride=stride).train()
    code, points = model.encode(random_pairs(3)), some_points(3)
    loss = model.decode(code, points).square().mean() + model.guidance(code, points, torch.ones(3, 200))
    loss.backward()
    silent = [n for n, p in model.named_parameters() if p.grad is None or p.grad.abs().max() < 1e-9]
    assert silent == []


def test_training_lowers_the_loss(config):
    model = build(config).train()
    views, points = random_pairs(2), some_points(2, 64)
    target = (points[..., 0] > 0).float()
    target[1] = 1 - target[1]  # only the images and cameras tell the samples apart
    optimizer = torch.optim.Adam(model.parameters(), lr=5e-3)
    losses = []
    for _ in range(25):
        loss = binary_cross_entropy_with_logits(model(views, points), target)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.25 < 0.5 < losses[0]


def test_initial_decoder_ignores_the_code_and_every_block_is_given_the_token():
    decoder = PointDecoder(6, 5, hidden=8, blocks=3)
    token = torch.randn(2, 4, 6)
    torch.testing.assert_close(decoder(torch.randn(2, 5), token), decoder(torch.zeros(2, 5), token))
    for block in range(3):
        other = PointDecoder(6, 5, hidden=8, blocks=3)
        other.load_state_dict(decoder.state_dict())
        other.inject.weight[8 * block : 8 * block + 8] = 0
        assert (other(torch.zeros(2, 5), token) - decoder(torch.zeros(2, 5), token)).abs().max() > 1e-3


def test_codes_are_gains_and_biases_of_each_block():
    decoder = PointDecoder(6, 5, hidden=8, blocks=1)
    decoder.modulate.bias[:8] = -1  # gains of 0
    decoder.modulate.bias[8:] = -1  # so that the block starts from ReLU(-1) = 0
    token = torch.randn(1, 4, 6)
    silent = decoder.blocks[0](torch.zeros(1, 1, 8))
    expected = decoder.head(decoder.inject(token) + silent).squeeze(-1)
    torch.testing.assert_close(decoder(torch.zeros(1, 5), token), expected)


def test_other_views_are_refused():
    encoder = LightEncoder(**{key: ENCODER[key] for key in ("channels", "widths", "blocks")}, stride=4)
    settings = {"groups": 2, "frequencies": 2, "code_size": 8, "hidden": 8, "blocks": 1}
    with pytest.raises(UserError, match=r"model\.views: must be one of both, left, got right"):
        PixelStereoModel(encoder, views="right", **settings)
