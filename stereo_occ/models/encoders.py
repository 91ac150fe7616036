"""Image encoders: one image to one map of features."""

from collections.abc import Iterable, Sequence
from functools import partial
from itertools import cycle, islice

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, relu

from stereo_occ.errors import UserError
from stereo_occ.models.residual import NormActivation, ResidualBlock

RELU = partial(relu, inplace=True)


class ImageEncoder(nn.Module):
    """Maps RGB images ``(B, 3, H, W)`` in [0, 1] to features ``(B, channels, H / stride, W / stride)``.

    Attributes:
        image_multiple: image sides must be a multiple of this many pixels.
        channels, stride: of the features.
    """

    image_multiple: int
    channels: int
    stride: int


class DilatedResNet(ImageEncoder):
    """Three stages at strides 4, 8 and 16, the last with repeated dilations, merged back to stride 4.

    The feature extractor of Shankar et al., "A Learned Stereo Depth System for Robotic Manipulation in Homes"
    (RA-L 2022).

    Args:
        stride: 4 for the merged features; 16 or None for the last stage's.
        channels: of the merged features.
        widths, blocks: channels and residual blocks of each stage.
        dilations: of the last stage's blocks, repeated as often as it takes.

    Raises:
        UserError: on another stride, or if there are not three widths and three numbers of blocks.
    """

    image_multiple = 16

    def __init__(
        self,
        *,
        stride: int | None,
        channels: int,
        widths: Sequence[int],
        blocks: Sequence[int],
        dilations: Sequence[int],
    ) -> None:
        super().__init__()
        for name, values in (("widths", widths), ("blocks", blocks)):
            if len(values) != 3:
                raise UserError(
                    f"model.encoder.{name}: must be three numbers, one per stage, got {list(values)}"
                )
        self.stride = choose_stride("dilated_resnet", stride, (4, 16))
        merge = self.stride == 4
        self.channels = channels if merge else widths[-1]
        self.stem = nn.Sequential(
            nn.Conv2d(3, widths[0], 3, stride=2, padding=1, bias=False), NormActivation(widths[0], RELU)
        )
        self.stages = nn.ModuleList(
            _stage(in_width, width, islice(cycle(rates), count))
            for in_width, width, count, rates in zip(
                (widths[0], *widths[:-1]), widths, blocks, ((1,), (1,), dilations), strict=True
            )
        )
        self.merges = nn.ModuleList(nn.Conv2d(width, channels, 1) for width in widths) if merge else None

    def forward(self, image_BCHW: Tensor) -> Tensor:
        """See :class:`ImageEncoder`."""
        x_BCHW: Tensor = self.stem(2 * image_BCHW - 1)  # 1/2
        maps = []  # 1/4, 1/8, 1/16
        for stage in self.stages:
            x_BCHW = stage(x_BCHW)
            maps.append(x_BCHW)
        if self.merges is None:
            return x_BCHW
        fine, middle, coarse = (merge(features) for merge, features in zip(self.merges, maps, strict=True))
        merged_BCHW: Tensor = fine + _double(middle + _double(coarse))
        return merged_BCHW


class ResNet18(ImageEncoder):
    """torchvision's ResNet-18 up to a stride, without its pooling and classifier.

    Inputs are normalised as the weights expect; from scratch they are centred to [-1, 1].

    Args:
        stride: 4, 8, 16 or 32; None is 32.
        weights: name of torchvision's weights, or None to start from scratch.
        load_weights: False leaves them random but keeps their normalisation, for a state dict to follow.

    Raises:
        UserError: on another stride, or on weights that are unknown or can neither be found nor fetched.
    """

    mean_C11: Tensor
    std_C11: Tensor

    def __init__(self, *, stride: int | None, weights: str | None, load_weights: bool) -> None:
        from torchvision.models import resnet18  # takes seconds, and no other encoder needs it

        from stereo_occ.models.pretrained import load_pretrained, named_weights

        super().__init__()
        self.stride = choose_stride("resnet18", stride, (4, 8, 16, 32))
        self.image_multiple = stride or 1  # without one asked for, nobody looks for places in the map
        source = named_weights(weights) if weights else None
        network = resnet18()
        if source and load_weights:
            remedy = "train from scratch with model.encoder.weights=null"
            load_pretrained(network, source, "model.encoder.weights", remedy)
        stages = (network.layer1, network.layer2, network.layer3, network.layer4)
        kept = stages[: self.stride.bit_length() - 2]  # the first is at stride 4
        self.channels = 64 * self.stride // 4
        self.layers = nn.Sequential(network.conv1, network.bn1, network.relu, network.maxpool, *kept)
        mean, std = (source.transforms().mean, source.transforms().std) if source else ([0.5], [0.5])
        self.register_buffer("mean_C11", torch.tensor(mean)[:, None, None], persistent=False)
        self.register_buffer("std_C11", torch.tensor(std)[:, None, None], persistent=False)

    def forward(self, image_BCHW: Tensor) -> Tensor:
        """See :class:`ImageEncoder`."""
        features_BCHW: Tensor = self.layers((image_BCHW - self.mean_C11) / self.std_C11)
        return features_BCHW


def _stage(in_width: int, width: int, dilations: Iterable[int]) -> nn.Sequential:
    """Halve the resolution, then one residual block per dilation."""
    return nn.Sequential(
        nn.Conv2d(in_width, width, 3, stride=2, padding=1, bias=False),
        *(ResidualBlock(width, width, dilation, RELU) for dilation in dilations),
        NormActivation(width, RELU),
    )


def _double(x_BCHW: Tensor) -> Tensor:
    return interpolate(x_BCHW, scale_factor=2.0, mode="bilinear", align_corners=False)


def choose_stride(encoder: str, stride: int | None, strides: Sequence[int]) -> int:
    """The stride asked for, or the encoder's coarsest.

    Args:
        encoder: its name, for messages.
        strides: that it has features at, the finest first.

    Raises:
        UserError: on another stride.
    """
    if stride is None:
        return strides[-1]
    if stride not in strides:
        raise UserError(
            f"model.feature_stride: {encoder} has features at strides {list(strides)}, got {stride}"
        )
    return stride
