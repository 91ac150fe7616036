"""Calibrated stereo with a shape prior: the pair swept over a grid of the working volume, and a 3D network on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from stereo_occ.errors import UserError
from stereo_occ.models.base import StereoViews
from stereo_occ.models.encoders import ImageEncoder
from stereo_occ.models.evidence import PairEvidence
from stereo_occ.models.pixel_stereo import CalibratedMaps, PixelStereoCode, PixelStereoModel
from stereo_occ.models.sampling import cell_centers, sample_volume
from stereo_occ.models.unet3d import UNet3d


class SweptVolume(nn.Module):
    """Evidence of both views at each cell of a grid over the cube ``[-0.5, 0.5]^3`` of the rig frame.

    A plane sweep (Collins, CVPR 1996) in world space: the cells are projected with the cameras given, so any rig will
    do, toed in or not. Each cell has both views' evidence, with their features' squared difference, and its place.

    Args:
        channels, groups: of the maps, see :class:`~stereo_occ.models.evidence.PairEvidence`.
        cells: per side.
        width: channels of the volume.
    """

    centers_N3: Tensor

    def __init__(self, channels: int, groups: int, cells: int, width: int) -> None:
        super().__init__()
        self.cells = cells
        self.register_buffer("centers_N3", cell_centers(cells), persistent=False)
        self.evidence = PairEvidence(channels, groups, width, torch.square)
        self.merge = nn.Linear(self.evidence.out_channels, width, bias=False)
        self.place = nn.Linear(3, width, bias=False)

    def forward(self, maps: CalibratedMaps) -> Tensor:
        """Volumes ``(B, width, cells, cells, cells)``, axes z, y, x."""
        centers_BN3 = self.centers_N3.expand(maps.features_VBCHW.shape[1], -1, -1)
        evidence_BEN = self.evidence(maps.features_VBCHW, maps.project(centers_BN3))
        place_CN = self.place(self.centers_N3).mT
        matrices_BCE = self.merge.weight.expand(len(evidence_BEN), -1, -1)
        volume_BCN = torch.baddbmm(place_CN, matrices_BCE, evidence_BEN)
        return volume_BCN.view(*volume_BCN.shape[:2], *(self.cells,) * 3)


@dataclass(frozen=True)
class PlaneSweepCode(PixelStereoCode):
    """With a volume ``(B, C, D, H, W)`` over the cube, axes z, y, x."""

    volume_BCDHW: Tensor


class PlaneSweepStereoModel(PixelStereoModel):
    """:class:`PixelStereoModel` whose points also read a volume of the scene, completed by a 3D U-Net.

    Args:
        grid: cells per side of the volume.
        widths: channels of each level of the U-Net, the finest first.
        views, groups, frequencies, code_size, hidden, blocks: see :class:`PixelStereoModel`.

    Raises:
        UserError: if the grid cannot be halved often enough.
    """

    def __init__(
        self,
        encoder: ImageEncoder,
        *,
        grid: int,
        widths: Sequence[int],
        views: str,
        groups: int,
        frequencies: int,
        code_size: int,
        hidden: int,
        blocks: int,
    ) -> None:
        super().__init__(
            encoder,
            widths[0],
            views=views,
            groups=groups,
            frequencies=frequencies,
            code_size=code_size,
            hidden=hidden,
            blocks=blocks,
        )
        self.sweep = SweptVolume(encoder.channels, groups, grid, widths[0])
        self.unet = UNet3d(widths)
        if grid % self.unet.multiple:
            raise UserError(
                f"model.grid: must be a multiple of {self.unet.multiple} for {len(widths)} model.widths, got {grid}"
            )

    def encode(self, views: StereoViews) -> PlaneSweepCode:
        """Maps of the views, their common code and the completed volume."""
        pair = super().encode(views)
        return PlaneSweepCode(pair.maps, pair.global_BC, self.unet(self.sweep(pair.maps)))

    def token(self, code: PixelStereoCode, points_BN3: Tensor) -> Tensor:
        """Evidence, place and the volume's features ``(B, N, T)`` of each point."""
        assert isinstance(code, PlaneSweepCode)
        return torch.cat(
            [super().token(code, points_BN3), sample_volume(code.volume_BCDHW, points_BN3).mT], dim=-1
        )
