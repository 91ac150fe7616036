"""Cost volumes: left features against right features at a range of disparities.

Disparities are whole feature cells. At disparity d the left cell u meets the right cell ``u - d``; where that
lies outside the right image, the volume is 0.
"""

from abc import abstractmethod
from collections.abc import Sequence
from math import ceil, floor

import torch
from torch import Tensor, nn
from torch.nn.functional import pad

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.models.disparity import disparity_range

WORKING_RADIUS = 0.5  # metres about the fixation point: the sphere about a unit-diagonal object


class CostVolume(nn.Module):
    """Maps left and right features ``(B, C, H, W)`` to a float32 volume ``(B, out_channels, D, H, W)``.

    Attributes:
        disparities: of the D slices, in feature cells; consecutive.
        out_channels: of the volume.
    """

    out_channels: int

    def __init__(self, disparities: Sequence[int]) -> None:
        super().__init__()
        self.disparities = tuple(disparities)

    def forward(self, left_BCHW: Tensor, right_BCHW: Tensor) -> Tensor:
        """See the class; float32 under autocast too, where half precision loses matches."""
        return self.compare(left_BCHW.float()[:, :, None], shift(right_BCHW.float(), self.disparities))

    @abstractmethod
    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """The volume from left features and shifted right features."""


class Correlation(CostVolume):
    """Channel-wise products, not summed: the paper's four-dimensional volume."""

    def __init__(self, channels: int, disparities: Sequence[int]) -> None:
        super().__init__(disparities)
        self.out_channels = channels

    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """See :class:`CostVolume`."""
        return left_BC1HW * right_BCDHW


class Groupwise(CostVolume):
    """Products averaged over groups of channels (Guo et al., GwcNet, CVPR 2019).

    Raises:
        UserError: if the groups do not divide the channels.
    """

    def __init__(self, channels: int, disparities: Sequence[int], *, groups: int) -> None:
        super().__init__(disparities)
        if groups < 1 or channels % groups:
            raise UserError(
                f"model.cost_volume.groups: must divide the encoder's {channels} channels, got {groups}"
            )
        self.out_channels = groups

    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """See :class:`CostVolume`."""
        products_BCDHW = left_BC1HW * right_BCDHW
        B, _, *DHW = products_BCDHW.shape
        return products_BCDHW.reshape(B, self.out_channels, -1, *DHW).mean(dim=2)


class Concat(CostVolume):
    """Left features beside shifted right features (Chang and Chen, PSMNet, CVPR 2018)."""

    def __init__(self, channels: int, disparities: Sequence[int]) -> None:
        super().__init__(disparities)
        self.out_channels = 2 * channels

    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """See :class:`CostVolume`."""
        inside_DHW = shift(torch.ones_like(right_BCDHW[:1, :1, 0]), self.disparities)[0]
        return torch.cat([left_BC1HW * inside_DHW, right_BCDHW], dim=1)


def shift(features_BCHW: Tensor, disparities: Sequence[int]) -> Tensor:
    """``(B, C, D, H, W)``: slice k at u is ``features[..., u - disparities[k]]``, 0 outside the image."""
    width = features_BCHW.shape[-1]
    left, right = max(0, *disparities), max(0, *(-d for d in disparities))
    padded_BCHW = pad(features_BCHW, (left, right))
    return torch.stack([padded_BCHW[..., left - d : left - d + width] for d in disparities], dim=2)


def one_sided(count: int) -> range:
    """Disparities ``0 .. count - 1`` in feature cells.

    Raises:
        UserError: if there are none.
    """
    if count < 1:
        raise UserError(f"model.cost_volume.disparities: must be at least 1, got {count}")
    return range(count)


def calibrated(rig: StereoRig, stride: int) -> range:
    """All disparities, in cells of ``stride`` pixels, that the ball about the fixation point can have."""
    least, greatest = disparity_range(rig, WORKING_RADIUS)
    return range(floor(least / stride), ceil(greatest / stride) + 1)
