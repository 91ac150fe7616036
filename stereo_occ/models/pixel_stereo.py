"""Calibrated stereo with local evidence: every query point is looked up in both images."""

from dataclasses import dataclass

import torch
from torch import Tensor

from stereo_occ.errors import UserError
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.encoders import ImageEncoder
from stereo_occ.models.evidence import GlobalCode, PairEvidence, positional_encoding
from stereo_occ.models.point_decoder import PointDecoder
from stereo_occ.models.sampling import Projections, cell_rays, project_points, ray_maps

VIEWS = {"both": 2, "left": 1}  # how many are encoded
PIXEL_CHANNELS = 8  # of the evidence read from the images themselves
SAMPLES = 65536  # points times batch that are answered at once, which bounds the memory


@dataclass(frozen=True)
class CalibratedMaps:
    """Features of the views and the cameras that saw them.

    Attributes:
        features_VBCHW: maps of one or two views.
        images_VB3HW: their images.
        K_VB33, camera_from_rig_VB44: their cameras.
    """

    features_VBCHW: Tensor
    images_VB3HW: Tensor
    K_VB33: Tensor
    camera_from_rig_VB44: Tensor

    def project(self, points_BN3: Tensor) -> Projections:
        """Rig-frame points in each view."""
        height, width = self.images_VB3HW.shape[-2:]
        return project_points(points_BN3, self.K_VB33, self.camera_from_rig_VB44, width, height)

    def cell_rays(self) -> tuple[Tensor, Tensor]:
        """:func:`~stereo_occ.models.sampling.cell_rays` of the maps' cells."""
        height, width = self.features_VBCHW.shape[-2:]
        stride = self.images_VB3HW.shape[-1] // width
        return cell_rays(self.K_VB33, self.camera_from_rig_VB44, height, width, stride)

    def rays(self) -> Tensor:
        """Lines of sight ``(V, B, 6, H, W)`` of the maps' cells."""
        rays_VB6P = ray_maps(*self.cell_rays())
        return rays_VB6P.view(*rays_VB6P.shape[:3], *self.features_VBCHW.shape[-2:])


@dataclass(frozen=True)
class PixelStereoCode:
    """What :meth:`PixelStereoModel.decode` needs of a pair: its maps and one code for the whole."""

    maps: CalibratedMaps
    global_BC: Tensor


class PixelStereoModel(OccupancyModel):
    """Shared encoder, projected points, residual decoder.

    Pixel-aligned features (Saito et al., "PIFu", ICCV 2019) with what a calibrated pair adds, and the pixels, which are
    finer than the features. The cameras are an input. Nothing changes if left and right change places with them.

    Args:
        extra: channels that a subclass adds to the token.
        views: ``both``; or for comparison, with the same parameters, ``left`` (nothing is seen by the right view).
        groups: of channels, for the correlation.
        frequencies: of the positional encoding.
        code_size: channels of the code for the whole pair.
        hidden, blocks: of the decoder; ``hidden`` is also the width of each view's embedding.

    Raises:
        UserError: on other views, or if the groups do not divide the encoder's channels.
    """

    def __init__(
        self,
        encoder: ImageEncoder,
        extra: int = 0,
        *,
        views: str,
        groups: int,
        frequencies: int,
        code_size: int,
        hidden: int,
        blocks: int,
    ) -> None:
        super().__init__()
        if views not in VIEWS:
            raise UserError(f"model.views: must be one of {', '.join(VIEWS)}, got {views}")
        self.views = VIEWS[views]
        self.frequencies = frequencies
        self.encoder = encoder
        self.evidence = PairEvidence(encoder.channels, groups, encoder.channels, torch.abs)
        self.pixels = PairEvidence(3, 1, PIXEL_CHANNELS, torch.abs)
        self.global_code = GlobalCode(encoder.channels, code_size)
        token_size = self.evidence.out_channels + self.pixels.out_channels + 3 + 6 * frequencies + extra
        self.decoder = PointDecoder(token_size, code_size, hidden=hidden, blocks=blocks)

    def encode(self, views: StereoViews) -> PixelStereoCode:
        """Maps of the views and their common code."""
        maps = self.calibrated_maps(views)
        return PixelStereoCode(maps, self.global_code(maps.features_VBCHW, maps.rays()))

    def calibrated_maps(self, views: StereoViews) -> CalibratedMaps:
        """Features of the chosen views with their cameras."""
        images_VB3HW = torch.stack((views.left_BCHW, views.right_BCHW)[: self.views])
        return CalibratedMaps(
            self.encoder(images_VB3HW.flatten(0, 1)).unflatten(0, images_VB3HW.shape[:2]),
            images_VB3HW,
            views.K_B233[:, : self.views].transpose(0, 1),
            views.camera_from_rig_B244[:, : self.views].transpose(0, 1),
        )

    def decode(self, code: PixelStereoCode, points_BN3: Tensor) -> Tensor:
        """Logits ``(B, N)``."""
        at_once = max(1, SAMPLES // len(points_BN3))
        return torch.cat(
            [self.answer(code, some_BN3) for some_BN3 in torch.split(points_BN3, at_once, dim=1)], dim=1
        )

    def answer(self, code: PixelStereoCode, points_BN3: Tensor) -> Tensor:
        """:meth:`decode` of all points at once."""
        token_BNT = self.token(code, points_BN3, code.maps.project(points_BN3))
        logits_BN: Tensor = self.decoder(code.global_BC, token_BNT)
        return logits_BN

    def token(self, code: PixelStereoCode, points_BN3: Tensor, projections: Projections) -> Tensor:
        """Evidence and place ``(B, N, T)`` of each point, which the views see at ``projections``."""
        evidence_BEN = self.evidence(code.maps.features_VBCHW, projections)
        pixels_BEN = self.pixels(code.maps.images_VB3HW, projections)
        return torch.cat(
            [evidence_BEN.mT, pixels_BEN.mT, positional_encoding(points_BN3, self.frequencies)], dim=-1
        )
