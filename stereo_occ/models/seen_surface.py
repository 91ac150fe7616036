"""The surface that each view sees, and how far points are behind it."""

from typing import cast

import torch
from torch import Tensor, nn

from stereo_occ.models.grid import Grid
from stereo_occ.models.pixel_stereo import CalibratedMaps
from stereo_occ.models.sampling import Projections, sample_maps, sample_volume

REACH = 0.6  # metres that lines of sight are followed before and behind the rig's origin
DEPTHS = 32  # places on each
UNSEEN = -30.0  # score of places outside the volume
HIDDEN = 32  # channels
SCALES = (0.1, 0.03, 0.01)  # metres: distances are told in full, and squashed at each of these
NEAR = 0.02  # metres: width of the bump that says that a point is at the surface


class SeenSurface(nn.Module):
    """Depths of what each view sees, read from a volume of the scene, and what points are told of them.

    Scores of the volume along the line of sight of each cell of the maps become shares, whose mean is the depth (the
    soft argmin of Kendall et al., GC-Net, ICCV 2017); two convolutions on the view's map correct it. A point is told
    how far it lies behind the surface of each view that it is in, averaged over the views (the relative z-offset of
    Hong et al., StereoPIFu, CVPR 2021): a wall is much thinner than a cell of the volume or of the maps, but an
    interval of that distance.

    Args:
        channels: of the maps.
        width: channels of the volume.
        out_channels: that points are told.
    """

    def __init__(self, channels: int, width: int, out_channels: int) -> None:
        super().__init__()
        self.score = nn.Conv3d(width, 1, 1, bias=False)
        correction = nn.Conv2d(HIDDEN, 1, 1)
        nn.init.zeros_(correction.weight)
        nn.init.zeros_(cast(Tensor, correction.bias))
        self.refine = nn.Sequential(
            nn.Conv2d(channels + 2, HIDDEN, 3, padding=1), nn.ReLU(inplace=True), correction
        )
        self.tell = nn.Linear(3 + len(SCALES), out_channels)

    def forward(self, volume_BCDHW: Tensor, grid: Grid, maps: CalibratedMaps) -> Tensor:
        """Depth along the optical axis less the rig's origin's, and its spread, metres, ``(V, B, 2, H, W)``.

        Args:
            volume_BCDHW: over the cells of ``grid``.
        """
        V, B, _, H, W = maps.features_VBCHW.shape
        depths_K = torch.linspace(-REACH, REACH, DEPTHS, device=volume_BCDHW.device)
        places_BM3 = grid.to_local(lines_of_sight(maps, depths_K).transpose(0, 1).flatten(1, 3))
        scores_BM = sample_volume(self.score(volume_BCDHW), places_BM3)[:, 0].float()
        scores_BM = scores_BM.masked_fill((places_BM3.abs() > 0.5).any(dim=-1), UNSEEN)
        shares_VBPK = scores_BM.view(B, V, H * W, DEPTHS).transpose(0, 1).softmax(dim=-1)
        with torch.autocast(volume_BCDHW.device.type, enabled=False):
            means_VBP = shares_VBPK @ depths_K
            variances_VBP = (shares_VBPK * (depths_K - means_VBP[..., None]).square()).sum(dim=-1)
        found_VB2HW = torch.stack([means_VBP, (variances_VBP + 1e-6).sqrt()], dim=2).view(V, B, 2, H, W)
        seen_VBCHW = torch.cat([maps.features_VBCHW, found_VB2HW.to(maps.features_VBCHW.dtype)], dim=2)
        correction_VB1HW = self.refine(seen_VBCHW.flatten(0, 1)).unflatten(0, (V, B)).float()
        depths_VB1HW, spreads_VB1HW = found_VB2HW.chunk(2, dim=2)
        return torch.cat([depths_VB1HW + correction_VB1HW, spreads_VB1HW], dim=2)

    def tell_points(self, surface_VB2HW: Tensor, points: Projections) -> Tensor:
        """What points are told ``(B, N, out_channels)`` of surfaces that :meth:`forward` found."""
        depths_VBN, spreads_VBN = sample_maps(surface_VB2HW, points.positions_VBN2).unbind(dim=2)
        behind_VBN = points.offsets_VBN3[..., 2] - depths_VBN
        squashed = (torch.tanh(behind_VBN / scale) for scale in SCALES)
        near_VBN = torch.exp(-(behind_VBN / NEAR).square())
        told_VBNT = torch.relu(self.tell(torch.stack([behind_VBN, *squashed, spreads_VBN, near_VBN], dim=-1)))
        return (told_VBNT * points.shares_VBN[..., None].to(told_VBNT.dtype)).sum(dim=0)


def lines_of_sight(maps: CalibratedMaps, depths_K: Tensor) -> Tensor:
    """Rig-frame points ``(V, B, H W, K, 3)`` seen by the maps' cells, row by row, at depths along the optical axis.

    Args:
        depths_K: less the depth of the rig's origin, metres.
    """
    centers_VB13, directions_VBP3 = maps.cell_rays()
    depths_VBK = maps.camera_from_rig_VB44[..., 2, 3:].float() + depths_K
    return centers_VB13[..., None, :] + depths_VBK[:, :, None, :, None] * directions_VBP3[..., None, :]
