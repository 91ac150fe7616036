"""Image encoders."""

import sys
from types import ModuleType, SimpleNamespace

import pytest
import torch
from torch import nn
from torch.nn.functional import avg_pool2d, conv2d
from torchvision.models import ResNet18_Weights, resnet18

from stereo_occ.errors import UserError
from stereo_occ.models.encoders import DilatedResNet, ResNet18
from stereo_occ.models.light import LightEncoder
from stereo_occ.models.residual import DilatedConv, ResidualBlock
from stereo_occ.models.timm_encoder import TimmEncoder

DILATED = {"channels": 16, "widths": [32, 64, 128], "blocks": [3, 4, 8], "dilations": [1, 2, 5, 9]}
LIGHT = {"channels": 32, "widths": [16, 32, 64, 128], "blocks": [1, 2, 2, 2]}
WEIGHTS_FILE = "resnet18-f37072fd.pth"


@pytest.mark.parametrize(
    ("encoder", "shape"),
    [
        (DilatedResNet(stride=4, **DILATED), (16, 16, 16)),
        (DilatedResNet(stride=None, **DILATED), (128, 4, 4)),
        (ResNet18(stride=4, weights=None, load_weights=True), (64, 16, 16)),
        (ResNet18(stride=16, weights=None, load_weights=True), (256, 4, 4)),
        (ResNet18(stride=None, weights=None, load_weights=True), (512, 2, 2)),
        (LightEncoder(stride=2, **LIGHT), (32, 32, 32)),
        (LightEncoder(stride=4, **LIGHT), (32, 16, 16)),
        (LightEncoder(stride=None, **LIGHT), (128, 4, 4)),
    ],
)
def test_features_are_what_the_attributes_say(encoder, shape):
    features = encoder(torch.rand(2, 3, 64, 64))
    assert features.shape == (2, *shape)
    assert (encoder.channels, 64 // encoder.stride) == shape[:2]


@pytest.mark.parametrize(
    ("encoder", "step"),
    [
        (DilatedResNet(stride=4, channels=16, widths=[8, 8, 8], blocks=[1, 1, 1], dilations=[1]), 16),
        (ResNet18(stride=4, weights=None, load_weights=True), 4),
        (LightEncoder(stride=4, channels=16, widths=[8, 8, 8, 8], blocks=[1, 1, 1, 1]), 16),
    ],
)
def test_an_image_shifted_by_pixels_shifts_its_features_by_pixels_over_the_stride(encoder, step):
    encoder.eval()
    strip = torch.rand(1, 3, 32, 336, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        left, right = encoder(strip[..., :320]), encoder(strip[..., step : step + 320])
    cells = step // 4
    torch.testing.assert_close(left[..., 30 + cells : 50 + cells], right[..., 30:50], atol=1e-4, rtol=1e-4)
    assert (left[..., 30:50] - right[..., 30:50]).abs().max() > 0.01


def test_dilated_stages_have_the_papers_blocks():
    encoder = DilatedResNet(stride=4, **DILATED)
    dilations = [
        [block.conv0.dilation[0] for block in stage if isinstance(block, ResidualBlock)]
        for stage in encoder.stages
    ]
    assert dilations == [[1, 1, 1], [1, 1, 1, 1], [1, 2, 5, 9, 1, 2, 5, 9]]


@pytest.mark.parametrize(("side", "dilation"), [(4, 9), (4, 4), (4, 3), (6, 5), (12, 5)])
def test_leaving_out_taps_that_meet_padding_changes_nothing(side, dilation):
    layer = DilatedConv(5, 7, dilation)
    x = torch.randn(2, 5, side, side)
    expected = conv2d(x, layer.weight, padding=dilation, dilation=dilation)
    torch.testing.assert_close(layer(x), expected)
    gradient, expected_gradient = (
        torch.autograd.grad(y.square().sum(), layer.weight)[0] for y in (layer(x), expected)
    )
    torch.testing.assert_close(gradient, expected_gradient)


def test_a_residual_block_without_last_convolution_is_its_shortcut():
    block = ResidualBlock(4, 4, 2, torch.relu)
    torch.nn.init.zeros_(block.conv1.weight)
    x = torch.randn(2, 4, 6, 6)
    torch.testing.assert_close(block(x), x)


def test_images_from_scratch_are_centred():
    for encoder in (
        DilatedResNet(stride=4, **DILATED),
        ResNet18(stride=4, weights=None, load_weights=True),
        LightEncoder(stride=4, **LIGHT),
    ):
        first = next(m for m in encoder.modules() if isinstance(m, torch.nn.Conv2d))
        seen = []
        first.register_forward_hook(lambda module, inputs, output, seen=seen: seen.append(inputs[0]))
        image = torch.rand(2, 3, 32, 32)
        encoder(image)
        torch.testing.assert_close(seen[0], 2 * image - 1)


def test_pretrained_resnet_is_torchvisions_network_on_normalised_images(torch_cache):
    reference = resnet18()
    torch.save(reference.state_dict(), torch_cache / WEIGHTS_FILE)
    encoder = ResNet18(stride=None, weights="IMAGENET1K_V1", load_weights=True).eval()
    reference.eval().fc = torch.nn.Identity()
    images = torch.rand(2, 3, 224, 224)
    transform = ResNet18_Weights.IMAGENET1K_V1.transforms(resize_size=224)
    with torch.no_grad():
        pooled = encoder(images).mean(dim=(2, 3))
        torch.testing.assert_close(pooled, reference(transform(images)), atol=1e-4, rtol=1e-4)


def test_missing_weights_name_the_file_and_the_way_out(torch_cache):
    with pytest.raises(UserError) as caught:
        ResNet18(stride=None, weights="IMAGENET1K_V1", load_weights=True)
    message = str(caught.value)
    assert str(torch_cache / WEIGHTS_FILE) in message
    assert "model.encoder.weights=null" in message
    assert "\n" not in message


def test_weights_that_follow_are_not_fetched_but_their_normalisation_is_kept(torch_cache):
    encoder = ResNet18(stride=None, weights="IMAGENET1K_V1", load_weights=False)
    torch.testing.assert_close(encoder.mean_C11.flatten(), torch.tensor([0.485, 0.456, 0.406]))


def test_unknown_weights_are_refused():
    with pytest.raises(UserError, match=r"model\.encoder\.weights: unknown 'V2'; use IMAGENET1K_V1"):
        ResNet18(stride=None, weights="V2", load_weights=True)


def test_a_stride_that_is_not_there_is_refused():
    with pytest.raises(
        UserError, match=r"model\.feature_stride: dilated_resnet has features at strides \[4, 16\], got 8"
    ):
        DilatedResNet(stride=8, **DILATED)


@pytest.mark.parametrize(("stride", "pixels"), [(2, 250), (4, 250)])
def test_a_light_feature_sees_the_whole_of_a_large_image(stride, pixels):
    encoder = LightEncoder(stride=stride, **LIGHT).double().eval()
    image = torch.rand(1, 3, 16, 512, dtype=torch.double, requires_grad=True)
    features = encoder(image)
    (gradient,) = torch.autograd.grad(features[0, :, 0, features.shape[-1] // 2].square().sum(), image)
    seen = gradient.abs().sum(dim=(0, 1, 2)).nonzero()
    assert seen.max() - seen.min() >= pixels


def test_light_stages_must_be_four():
    with pytest.raises(
        UserError, match=r"model\.encoder\.widths: must be four numbers, one per stage, got \[8"
    ):
        LightEncoder(stride=4, channels=8, widths=[8, 8, 8], blocks=[1, 1, 1, 1])


def test_stages_must_be_three():
    with pytest.raises(UserError, match=r"model\.encoder\.blocks: must be three numbers"):
        DilatedResNet(stride=4, **{**DILATED, "blocks": [3, 4]})


class Backbone(nn.Module):
    """Pooled images in the form of timm's ``features_only`` networks, at given strides."""

    def __init__(self, strides, output_fmt="NCHW"):
        super().__init__()
        self.strides, self.output_fmt = strides, output_fmt
        self.feature_info = SimpleNamespace(
            reduction=lambda: list(strides), channels=lambda: [3 * stride for stride in strides]
        )
        self.pretrained_cfg = {"mean": (0.4, 0.5, 0.6), "std": (0.1, 0.2, 0.3)}

    def forward(self, image):
        maps = [avg_pool2d(image, stride).repeat(1, stride, 1, 1) for stride in self.strides]
        return [m.permute(0, 2, 3, 1) for m in maps] if self.output_fmt == "NHWC" else maps


TIMM = {"channels": 8, "backbone": "pool", "pretrained": False, "load_weights": True}


@pytest.fixture
def timm(monkeypatch):
    """A timm that knows one backbone and records what it was asked for."""
    module = ModuleType("timm")
    module.asked = []
    module.backbone = Backbone([2, 4, 8, 16, 32])

    def create_model(name, *, pretrained, features_only):
        module.asked.append((name, pretrained, features_only))
        if name != "pool":
            raise RuntimeError(f"Unknown model ({name})")
        return module.backbone

    module.create_model = create_model
    monkeypatch.setitem(sys.modules, "timm", module)
    return module


@pytest.mark.parametrize(("stride", "shape"), [(4, (8, 16, 16)), (2, (8, 32, 32)), (None, (96, 2, 2))])
@pytest.mark.parametrize("output_fmt", ["NCHW", "NHWC"])
def test_maps_of_timm_are_merged_to_the_stride(timm, stride, shape, output_fmt):
    timm.backbone = Backbone([2, 4, 8, 16, 32], output_fmt)
    encoder = TimmEncoder(stride=stride, **TIMM).eval()
    assert (encoder.channels, 64 // encoder.stride) == shape[:2]
    image = torch.rand(2, 3, 64, 64)
    features = encoder(image)
    assert features.shape == (2, *shape)
    if stride is None:
        expected = avg_pool2d(2 * image - 1, 32).repeat(1, 32, 1, 1)
        torch.testing.assert_close(features, expected)


def test_weights_of_timm_come_with_their_normalisation_and_are_not_fetched_twice(timm):
    image = torch.rand(1, 3, 64, 64)
    settings = TIMM | {"pretrained": True}
    for load_weights in (True, False):
        encoder = TimmEncoder(stride=None, **settings | {"load_weights": load_weights})
        mean, std = torch.tensor([[0.4, 0.5, 0.6], [0.1, 0.2, 0.3]])[:, :, None, None]
        expected = avg_pool2d((image - mean) / std, 32).repeat(1, 32, 1, 1)
        torch.testing.assert_close(encoder(image), expected)
    assert timm.asked == [("pool", True, True), ("pool", False, True)]


def test_backbones_that_do_not_fit_are_refused(timm):
    with pytest.raises(
        UserError, match=r"backbone=poool: timm cannot make it \(Unknown model \(poool\)\); choose"
    ):
        TimmEncoder(stride=4, **TIMM | {"backbone": "poool"})
    timm.backbone = Backbone([16, 16, 16])
    with pytest.raises(UserError, match=r"backbone=pool: has maps at strides \[16, 16, 16\]; choose"):
        TimmEncoder(stride=16, **TIMM)
    timm.backbone = Backbone([4, 8, 16, 32])
    with pytest.raises(UserError, match=r"timm's pool has features at strides \[4, 8, 16, 32\], got 2"):
        TimmEncoder(stride=2, **TIMM)


def test_without_timm_its_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "timm", None)
    with pytest.raises(UserError, match=r"pip install 'stereo-occ\[timm\]'"):
        TimmEncoder(stride=4, **TIMM)
