"""A small residual 3D U-Net."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate

FEW = 2  # cells per side of a volume


class Conv3d(nn.Conv3d):
    """:class:`torch.nn.Conv3d` 3x3x3 without bias, whose gradients can be relied on in half precision.

    On CPUs with bfloat16 instructions but no matrix unit (seen on an AMD EPYC) oneDNN's weight gradient of two cells
    per side is read from memory that nothing was written to; so few cells are as fast in float32.
    """

    def __init__(self, in_channels: int, channels: int, stride: int) -> None:
        super().__init__(in_channels, channels, 3, stride=stride, padding=1, bias=False)

    def forward(self, x_BCDHW: Tensor) -> Tensor:
        """See the class."""
        if min(x_BCDHW.shape[2:]) > FEW or x_BCDHW.device.type != "cpu":
            return super().forward(x_BCDHW)
        with torch.autocast("cpu", enabled=False):
            return super().forward(x_BCDHW.float())


class ResidualBlock3d(nn.Module):
    """Two 3x3x3 convolutions, each after batch norm and ReLU, beside the identity."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            *_normalized_conv(channels, channels), *_normalized_conv(channels, channels)
        )

    def forward(self, x_BCDHW: Tensor) -> Tensor:
        """Same shape."""
        residual_BCDHW: Tensor = self.layers(x_BCDHW)
        return residual_BCDHW.add_(x_BCDHW)


class UNet3d(nn.Module):
    """Volume to volume of the same size, seen at ever coarser grids and merged back (Cicek et al., "3D U-Net", 2016).

    Args:
        widths: channels of each level, the finest first; each level has half the cells per side of the one before.

    Attributes:
        multiple: sides must be a multiple of this many cells.
    """

    def __init__(self, widths: Sequence[int]) -> None:
        super().__init__()
        self.multiple = 2 ** (len(widths) - 1)
        self.down = nn.ModuleList(
            nn.Sequential(*_normalized_conv(fine, coarse, stride=2), ResidualBlock3d(coarse))
            for fine, coarse in pairwise(widths)
        )
        self.lift = nn.ModuleList(nn.Conv3d(coarse, fine, 1, bias=False) for fine, coarse in pairwise(widths))
        self.up = nn.ModuleList(ResidualBlock3d(fine) for fine in widths[:-1])
        self.exit = nn.Sequential(nn.BatchNorm3d(widths[0]), nn.ReLU(inplace=True))

    def forward(self, volume_BCDHW: Tensor) -> Tensor:
        """``(B, widths[0], D, H, W)`` to the same shape."""
        x_BCDHW = volume_BCDHW.contiguous(memory_format=torch.channels_last_3d)
        finer = []
        for down in self.down:
            finer.append(x_BCDHW)
            x_BCDHW = down(x_BCDHW)
        for lift, up in zip(reversed(self.lift), reversed(self.up), strict=True):
            lifted_BCDHW = interpolate(lift(x_BCDHW), scale_factor=2.0, mode="trilinear", align_corners=False)
            x_BCDHW = up(finer.pop() + lifted_BCDHW)
        volume: Tensor = self.exit(x_BCDHW)
        return volume


def _normalized_conv(in_channels: int, channels: int, stride: int = 1) -> list[nn.Module]:
    return [
        nn.BatchNorm3d(in_channels),
        nn.ReLU(inplace=True),
        Conv3d(in_channels, channels, stride),
    ]
