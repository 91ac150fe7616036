"""Calibrated stereo with a shape prior: the pair swept over a grid of the working volume, and a 3D network on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from stereo_occ.errors import UserError
from stereo_occ.models.base import StereoViews
from stereo_occ.models.encoders import ImageEncoder
from stereo_occ.models.evidence import PairEvidence
from stereo_occ.models.grid import Grid, Locator, locator_loss, whole_cube
from stereo_occ.models.pixel_stereo import CalibratedMaps, PixelStereoCode, PixelStereoModel
from stereo_occ.models.sampling import Projections, cell_centers, sample_volume
from stereo_occ.models.seen_surface import SeenSurface
from stereo_occ.models.unet3d import UNet3d

AROUND = ("cube", "object")


class SweptVolume(nn.Module):
    """Evidence of both views at each cell of a grid.

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

    def forward(self, maps: CalibratedMaps, grid: Grid) -> Tensor:
        """Volumes ``(B, width, cells, cells, cells)``, axes z, y, x."""
        evidence_BEN = self.evidence(maps.features_VBCHW, maps.project(grid.to_rig(self.centers_N3)))
        place_CN = self.place(self.centers_N3).mT
        matrices_BCE = self.merge.weight.expand(len(evidence_BEN), -1, -1)
        volume_BCN = torch.baddbmm(place_CN, matrices_BCE, evidence_BEN)
        return volume_BCN.view(*volume_BCN.shape[:2], *(self.cells,) * 3)


@dataclass(frozen=True)
class PlaneSweepCode(PixelStereoCode):
    """With a volume ``(B, C, D, H, W)`` over the cells of a grid, axes z, y, x, and the surface found in it, if any."""

    grid: Grid
    volume_BCDHW: Tensor
    surface_VB2HW: Tensor | None


class PlaneSweepStereoModel(PixelStereoModel):
    """:class:`PixelStereoModel` whose points also read a volume of the scene, completed by a 3D U-Net.

    Args:
        grid: cells per side of the volume.
        around: ``cube``: the volume is over the whole working cube; ``object``: over a cube around the object, which
            a volume of half as many cells per side over the working cube finds first.
        widths: channels of each level of the U-Net, the finest first.
        surface_channels: that tell points how far they are behind the surface that the views see; None: it is not
            looked for.
        views, groups, frequencies, code_size, hidden, blocks: see :class:`PixelStereoModel`.

    Raises:
        UserError: if the grid cannot be halved often enough, or lies around something else.
    """

    def __init__(
        self,
        encoder: ImageEncoder,
        *,
        grid: int,
        around: str = "cube",
        widths: Sequence[int],
        surface_channels: int | None = None,
        views: str,
        groups: int,
        frequencies: int,
        code_size: int,
        hidden: int,
        blocks: int,
    ) -> None:
        if around not in AROUND:
            raise UserError(f"model.around: must be one of {', '.join(AROUND)}, got {around}")
        super().__init__(
            encoder,
            widths[0] + (surface_channels or 0) + (3 if around == "object" else 0),
            views=views,
            groups=groups,
            frequencies=frequencies,
            code_size=code_size,
            hidden=hidden,
            blocks=blocks,
        )
        self.sweep = SweptVolume(encoder.channels, groups, grid, widths[0])
        self.unet = UNet3d(widths)
        self.surface = (
            SeenSurface(encoder.channels, widths[0], surface_channels) if surface_channels else None
        )
        if grid % self.unet.multiple:
            raise UserError(
                f"model.grid: must be a multiple of {self.unet.multiple} for {len(widths)} model.widths, got {grid}"
            )
        self.scout = (
            SweptVolume(encoder.channels, groups, grid // 2, widths[0]) if around == "object" else None
        )
        self.locator = Locator(grid // 2, widths[0]) if around == "object" else None

    def encode(self, views: StereoViews) -> PlaneSweepCode:
        """Maps of the views, their common code and the completed volume."""
        pair = super().encode(views)
        grid = whole_cube(len(views.left_BCHW), views.left_BCHW.device)
        if self.scout is not None and self.locator is not None:
            grid = self.locator(self.scout(pair.maps, grid))
        volume_BCDHW = self.unet(self.sweep(pair.maps, grid.detach()))
        surface_VB2HW = self.surface(volume_BCDHW, grid.detach(), pair.maps) if self.surface else None
        return PlaneSweepCode(pair.maps, pair.global_BC, grid, volume_BCDHW, surface_VB2HW)

    def guidance(self, code: PlaneSweepCode, points_BN3: Tensor, occupied_BN: Tensor) -> Tensor:
        """The locator's loss."""
        if self.locator is None:
            return super().guidance(code, points_BN3, occupied_BN)
        return locator_loss(code.grid, points_BN3, occupied_BN)

    def seen_depths(self, code: PlaneSweepCode) -> Tensor | None:
        """Of the surface, if it is looked for."""
        return None if code.surface_VB2HW is None else code.surface_VB2HW[:, :, 0]

    def token(self, code: PixelStereoCode, points_BN3: Tensor, projections: Projections) -> Tensor:
        """Evidence, place, the volume's features, place behind the surface and in the grid ``(B, N, T)``."""
        assert isinstance(code, PlaneSweepCode)
        local_BN3 = code.grid.detach().to_local(points_BN3)
        volume_BNC = sample_volume(code.volume_BCDHW, local_BN3).mT
        parts = [super().token(code, points_BN3, projections), volume_BNC]
        if self.surface is not None and code.surface_VB2HW is not None:
            parts.append(self.surface.tell_points(code.surface_VB2HW, projections))
        if self.locator is not None:
            parts.append(local_BN3.clamp(-1, 1))
        return torch.cat(parts, dim=-1)
