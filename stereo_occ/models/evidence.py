"""What a calibrated pair says about points: features of both views, and how well they agree."""

from collections.abc import Callable
from math import pi

import torch
from torch import Tensor, nn
from torch.nn.functional import relu

from stereo_occ.errors import UserError
from stereo_occ.models.sampling import Projections, sample_maps


class PairEvidence(nn.Module):
    """Features of points from the views they are seen in, the same if left and right change places.

    A layer that both views share embeds each view's features with the point's place in that camera's frame; the mean
    over the views that see the point follows. Where both do, correlation by groups of channels (Guo et al., GwcNet,
    CVPR 2019) and the difference of the features are added, elsewhere 0. One view alone counts as a pair whose other
    view sees nothing.

    Args:
        channels: of the sampled maps.
        groups: of channels, for the correlation.
        width: channels of the embedding.
        difference: even function of the difference of the features.

    Raises:
        UserError: if the groups do not divide the channels.

    Attributes:
        out_channels: width + groups + channels + 2 flags: whether both views see the point, and the share that do.
    """

    def __init__(
        self, channels: int, groups: int, width: int, difference: Callable[[Tensor], Tensor]
    ) -> None:
        super().__init__()
        if channels % groups:
            raise UserError(f"model.groups: must divide the encoder's {channels} channels, got {groups}")
        self.groups = groups
        self.difference = difference
        self.view = nn.Linear(channels + 4, width)
        self.out_channels = width + groups + channels + 2

    def forward(self, features_VBCHW: Tensor, points: Projections) -> Tensor:
        """Maps of one or two views and points in them to ``(B, N, out_channels)``."""
        samples_VBNC = sample_maps(features_VBCHW, points.positions_VBN2)
        seen_VBN1 = points.visible_VBN[..., None]
        place_VBN4 = torch.cat([points.offsets_VBN3, points.depths_VBN[..., None].log()], dim=-1)
        views_VBNE = relu(self.view(torch.cat([samples_VBNC, place_VBN4], dim=-1)))
        count_BN1 = seen_VBN1.sum(dim=0)
        mean_BNE = (views_VBNE * (seen_VBN1 / count_BN1.clamp(min=1))).sum(dim=0)
        views = samples_VBNC.unbind()
        left_BNC, right_BNC = views[0], views[-1]
        both_BN1 = (count_BN1 == 2).float()
        correlation_BNG = groupwise_correlation(left_BNC, right_BNC, self.groups) * both_BN1
        difference_BNC = self.difference(left_BNC - right_BNC) * both_BN1
        return torch.cat([mean_BNE, correlation_BNG, difference_BNC, both_BN1, count_BN1 / 2], dim=-1)


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


def groupwise_correlation(left_C: Tensor, right_C: Tensor, groups: int) -> Tensor:
    """Products of features ``(..., C)`` averaged over each of ``(..., groups)`` groups of channels."""
    return (left_C * right_C).view(*left_C.shape[:-1], groups, -1).mean(dim=-1)


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
