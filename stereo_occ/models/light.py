"""A small image encoder for CPUs, and the merging of feature maps it shares with others."""

from collections.abc import Sequence
from itertools import pairwise

from torch import Tensor, nn
from torch.nn.functional import interpolate

from stereo_occ.errors import UserError
from stereo_occ.models.encoders import RELU, ImageEncoder, choose_stride
from stereo_occ.models.residual import NormActivation, ResidualBlock


class TopDown(nn.Module):
    """Maps of ever coarser resolution, merged into the finest (Lin et al., "Feature Pyramid Networks", CVPR 2017).

    Args:
        widths: channels of the maps, the finest first; each has half the resolution of the one before.
        channels: of the result.
    """

    def __init__(self, widths: Sequence[int], channels: int) -> None:
        super().__init__()
        self.laterals = nn.ModuleList(nn.Conv2d(width, channels, 1) for width in widths)
        self.blocks = nn.ModuleList(ResidualBlock(channels, channels, 1, RELU) for _ in widths[1:])

    def forward(self, maps: Sequence[Tensor]) -> Tensor:
        """Maps to one ``(B, channels, H, W)`` of the finest resolution."""
        *finer, coarsest = (lateral(features) for lateral, features in zip(self.laterals, maps, strict=True))
        x_BCHW: Tensor = coarsest
        for block, fine_BCHW in zip(self.blocks, reversed(finer), strict=True):
            doubled_BCHW = interpolate(x_BCHW, scale_factor=2.0, mode="bilinear", align_corners=False)
            x_BCHW = block(fine_BCHW + doubled_BCHW)
        return x_BCHW


class LightEncoder(ImageEncoder):
    """A residual U-Net: four stages at strides 2, 4, 8 and 16, merged back to one of them.

    With the shipped settings a feature sees 250 pixels across.

    Args:
        stride: 2, 4 or 8 for merged features; 16 or None for the last stage's own.
        channels: of the merged features.
        widths, blocks: channels and residual blocks of each stage.

    Raises:
        UserError: on another stride, or if there are not four widths and four numbers of blocks.
    """

    image_multiple = 16

    def __init__(
        self, *, stride: int | None, channels: int, widths: Sequence[int], blocks: Sequence[int]
    ) -> None:
        super().__init__()
        for name, values in (("widths", widths), ("blocks", blocks)):
            if len(values) != 4:
                raise UserError(
                    f"model.encoder.{name}: must be four numbers, one per stage, got {list(values)}"
                )
        strides = (2, 4, 8, 16)
        self.stride = choose_stride("light", stride, strides)
        self.stages = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(fine, coarse, 3, stride=2, padding=1, bias=False),
                *(ResidualBlock(coarse, coarse, 1, RELU) for _ in range(count)),
                NormActivation(coarse, RELU),
            )
            for (fine, coarse), count in zip(pairwise((3, *widths)), blocks, strict=True)
        )
        self.first = strides.index(self.stride)
        merge = self.first < len(strides) - 1
        self.channels = channels if merge else widths[-1]
        self.merge = TopDown(widths[self.first :], channels) if merge else None

    def forward(self, image_BCHW: Tensor) -> Tensor:
        """See :class:`ImageEncoder`."""
        x_BCHW = 2 * image_BCHW - 1
        maps = []
        for stage in self.stages:
            x_BCHW = stage(x_BCHW)
            maps.append(x_BCHW)
        if self.merge is None:
            return x_BCHW
        merged_BCHW: Tensor = self.merge(maps[self.first :])
        return merged_BCHW
