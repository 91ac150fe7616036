"""The paper's stereo occupancy network: a cost volume, summarised into one code."""

from functools import partial
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.cost_volumes import CostVolume
from stereo_occ.models.decoders import ONet
from stereo_occ.models.encoders import ImageEncoder
from stereo_occ.models.residual import NormActivation, ResidualBlock

LEAKY = partial(leaky_relu, negative_slope=0.1, inplace=True)


class VolumeSummary(nn.Module):
    """A cost volume to one code: 3D convolutions, dilated 2D residual blocks, strided convolutions, mean.

    The first two parts are those of Shankar et al. (2022), whose blocks end with one channel per disparity.

    Args:
        channels, slices: of the volume.
        width: channels of the last two blocks; the first has four and the second two times as many.
        code_size: channels of the code.
    """

    def __init__(self, channels: int, slices: int, width: int, code_size: int) -> None:
        super().__init__()
        self.volume = nn.Sequential(_conv3d(channels, 8), _conv3d(8, 4))
        widths = (4 * slices, 4 * width, 2 * width, width, width)
        self.blocks = nn.Sequential(
            *(
                ResidualBlock(in_width, out_width, dilation, LEAKY)
                for (in_width, out_width), dilation in zip(pairwise(widths), (1, 2, 5, 9), strict=True)
            ),
            NormActivation(width, LEAKY),
        )
        self.reduce = nn.Sequential(_halve(width, 64), _halve(64, 128), _halve(128, 256))
        self.code = nn.Linear(256, code_size)

    def forward(self, volume_BGDHW: Tensor) -> Tensor:
        """Codes ``(B, code_size)``."""
        x_BCHW = self.volume(volume_BGDHW).flatten(1, 2)
        x_BCHW = self.reduce(self.blocks(x_BCHW))  # 256 channels at 1/8 of the volume's resolution
        code_BC: Tensor = self.code(x_BCHW.mean(dim=(2, 3)))
        return code_BC


class StereoModel(OccupancyModel):
    """Shared encoder, cost volume, summary, decoder (section 3.1 of the paper).

    Of the cost volumes the plane sweep alone looks at the cameras.
    """

    def __init__(
        self, encoder: ImageEncoder, cost_volume: CostVolume, decoder: ONet, *, width: int, code_size: int
    ) -> None:
        super().__init__()
        self.encoder = encoder
        self.cost_volume = cost_volume
        self.summary = VolumeSummary(cost_volume.out_channels, cost_volume.slices, width, code_size)
        self.decoder = decoder

    def encode(self, views: StereoViews) -> Tensor:
        """Codes ``(B, code_size)``."""
        features_BCHW = self.encoder(torch.cat([views.left_BCHW, views.right_BCHW]))
        pairs = views.left_BCHW.shape[0]
        code_BC: Tensor = self.summary(self.cost_volume(features_BCHW[:pairs], features_BCHW[pairs:], views))
        return code_BC

    def decode(self, code: Tensor, points_BN3: Tensor) -> Tensor:
        """Logits ``(B, N)``."""
        logits_BN: Tensor = self.decoder(code, points_BN3)
        return logits_BN


def _conv3d(in_channels: int, channels: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv3d(in_channels, channels, 3, padding=1, bias=False),
        nn.BatchNorm3d(channels),
        nn.LeakyReLU(0.1, inplace=True),
    )


def _halve(in_channels: int, channels: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(in_channels, channels, 3, stride=2, padding=1, bias=False), NormActivation(channels, LEAKY)
    )
