"""What a calibrated pair says about points: features of both views, and how well they agree."""

from collections.abc import Callable
from functools import reduce
from math import pi

import torch
from torch import Tensor, nn
from torch.nn.functional import relu

from stereo_occ.errors import UserError
from stereo_occ.models.sampling import Projections, sample_maps


class PairEvidence(nn.Module):
    """Features of points from the views they are seen in, the same if left and right change places.

    Both views' maps pass one linear layer and are then read at the points, which are many more than the maps' cells;
    the layer would give the same after the reading. What is read, with the point's place in that camera's frame added
    by another linear layer, is rectified and averaged over the views that see the point. Where both do, the
    correlation of what was read by groups of channels (Guo et al., GwcNet, CVPR 2019) and its difference follow,
    elsewhere 0. One view alone counts as a pair whose other view sees nothing.

    Args:
        channels: of the maps.
        groups: of channels, for the correlation.
        width: channels that are read.
        difference: even function of the difference of the features.

    Raises:
        UserError: if the groups do not divide the width.

    Attributes:
        out_channels: 2 width + groups + 2 flags: whether both views see the point, and the share that do.
    """

    def __init__(
        self, channels: int, groups: int, width: int, difference: Callable[[Tensor], Tensor]
    ) -> None:
        super().__init__()
        if width % groups:
            raise UserError(f"model.groups: must divide the {width} channels of the evidence, got {groups}")
        self.groups = groups
        self.difference = difference
        self.reduce = nn.Conv2d(channels, width, 1)
        self.place = nn.Linear(4, width, bias=False)
        self.out_channels = 2 * width + groups + 2

    def forward(self, features_VBCHW: Tensor, points: Projections) -> Tensor:
        """Maps of one or two views and points in them to ``(B, out_channels, N)``."""
        reduced_VBCHW = self.reduce(features_VBCHW.flatten(0, 1)).unflatten(0, features_VBCHW.shape[:2])
        samples_VBCN = sample_maps(reduced_VBCHW, points.positions_VBN2)
        place_VB4N = torch.cat([points.offsets_VBN3.mT, points.depths_VBN[:, :, None].log()], dim=2)
        views_VBCN = relu(add_linear(samples_VBCN, self.place.weight, place_VB4N))
        count_B1N = points.visible_VBN.sum(dim=0)[:, None].to(samples_VBCN.dtype)
        weights_VB1N = points.shares_VBN[:, :, None].to(samples_VBCN.dtype)
        weighted = (view * weight for view, weight in zip(views_VBCN, weights_VB1N, strict=True))
        mean_BCN = reduce(torch.add, weighted)
        left_BCN, right_BCN = samples_VBCN[0], samples_VBCN[-1]
        both_B1N = (count_B1N == 2).to(samples_VBCN.dtype)
        correlation_BGN = groupwise_correlation(left_BCN, right_BCN, self.groups) * both_B1N
        difference_BCN = self.difference((left_BCN - right_BCN) * both_B1N)
        return torch.cat([mean_BCN, correlation_BGN, difference_BCN, both_B1N, count_B1N / 2], dim=1)


class GlobalCode(nn.Module):
    """One code for all views: what each shows and along which lines of sight, averaged over cells and views."""

    def __init__(self, channels: int, size: int) -> None:
        super().__init__()
        self.maps = nn.Sequential(*_halve(channels + 6, 64), *_halve(64, 128))
        self.code = nn.Sequential(nn.Linear(128, size), nn.ReLU(inplace=True))

    def forward(self, features_VBCHW: Tensor, rays_VB6HW: Tensor) -> Tensor:
        """Maps and their :func:`~stereo_occ.models.sampling.ray_maps` to codes ``(B, size)``."""
        maps_MCHW: Tensor = self.maps(torch.cat([features_VBCHW, rays_VB6HW], dim=2).flatten(0, 1))
        means_VBC = maps_MCHW.mean(dim=(2, 3)).view(*features_VBCHW.shape[:2], -1)
        code_BC: Tensor = self.code(means_VBC.mean(dim=0))
        return code_BC


def add_linear(sum_ABCN: Tensor, weight_CD: Tensor, x_ABDN: Tensor) -> Tensor:
    """Add the linear layer of every column to ``sum_ABCN`` without a copy in another order of the axes."""
    matrices_MCD = weight_CD.expand(sum_ABCN.shape[:2].numel(), -1, -1)
    added_MCN = torch.baddbmm(sum_ABCN.flatten(0, 1), matrices_MCD, x_ABDN.flatten(0, 1))
    return added_MCN.view_as(sum_ABCN)


def groupwise_correlation(left_BCN: Tensor, right_BCN: Tensor, groups: int) -> Tensor:
    """Products of features averaged over each group of channels, ``(B, groups, N)``."""
    B, C, N = left_BCN.shape
    return (left_BCN * right_BCN).view(B, groups, C // groups, N).mean(dim=2)


def positional_encoding(points_BN3: Tensor, frequencies: int) -> Tensor:
    """Coordinates with their sines and cosines at pi, 2 pi, 4 pi, ... rad/m, ``(B, N, 3 + 6 frequencies)``."""
    rates_F = pi * 2.0 ** torch.arange(frequencies, device=points_BN3.device)
    phases_BNP = (points_BN3.float()[..., None] * rates_F).flatten(-2)
    return torch.cat([points_BN3.float(), phases_BNP.sin(), phases_BNP.cos()], dim=-1)


def _halve(in_channels: int, channels: int) -> list[nn.Module]:
    return [
        nn.Conv2d(in_channels, channels, 3, stride=2, padding=1, bias=False),
        nn.BatchNorm2d(channels),
        nn.ReLU(inplace=True),
    ]
