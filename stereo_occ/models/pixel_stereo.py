"""Calibrated stereo with local evidence: every query point is looked up in both images."""

from dataclasses import dataclass

import torch
from torch import Tensor

from stereo_occ.errors import UserError
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.encoders import ImageEncoder
from stereo_occ.models.evidence import GlobalCode, PairEvidence, positional_encoding
from stereo_occ.models.point_decoder import PointDecoder
from stereo_occ.models.sampling import Projections, project_points, ray_maps

VIEWS = {"both": (0, 1), "left": (0,), "left_twice": (0, 0)}
SAMPLES = 65536  # points times batch that are answered at once, which bounds the memory


@dataclass(frozen=True)
class CalibratedMaps:
    """Features of the views and the cameras that saw them.

    Attributes:
        features_VBCHW: maps of one or two views.
        K_VB33, camera_from_rig_VB44: their cameras.
        width, height: of the images, pixels.
    """

    features_VBCHW: Tensor
    K_VB33: Tensor
    camera_from_rig_VB44: Tensor
    width: int
    height: int

    def project(self, points_BN3: Tensor) -> Projections:
        """Rig-frame points in each view."""
        return project_points(points_BN3, self.K_VB33, self.camera_from_rig_VB44, self.width, self.height)

    def rays(self) -> Tensor:
        """Lines of sight ``(V, B, 6, H, W)`` of the maps' cells."""
        height, width = self.features_VBCHW.shape[-2:]
        return ray_maps(self.K_VB33, self.camera_from_rig_VB44, height, width, self.width // width)


@dataclass(frozen=True)
class PixelStereoCode:
    """What :meth:`PixelStereoModel.decode` needs of a pair: its maps and one code for the whole."""

    maps: CalibratedMaps
    global_BC: Tensor


class PixelStereoModel(OccupancyModel):
    """Shared encoder, projected points, residual decoder.

    Pixel-aligned features (Saito et al., "PIFu", ICCV 2019) with what a calibrated pair adds. The cameras are an input.
    Nothing changes if left and right change places with their cameras.

    Args:
        extra: channels that a subclass adds to the token.
        views: ``both``; or for comparison, with the same parameters, ``left`` (nothing is seen by the right view) or
            ``left_twice`` (the right view is the left one again, image and camera).
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
        self.evidence = PairEvidence(encoder.channels, groups, hidden, torch.abs)
        self.global_code = GlobalCode(encoder.channels, code_size)
        token_size = self.evidence.out_channels + 3 + 6 * frequencies + extra
        self.decoder = PointDecoder(token_size, code_size, hidden=hidden, blocks=blocks)

    def encode(self, views: StereoViews) -> PixelStereoCode:
        """Maps of the views and their common code."""
        maps = self.calibrated_maps(views)
        return PixelStereoCode(maps, self.global_code(maps.features_VBCHW, maps.rays()))

    def calibrated_maps(self, views: StereoViews) -> CalibratedMaps:
        """Features of the chosen views with their cameras."""
        index = list(self.views)
        images = (views.left_BCHW, views.right_BCHW)[: max(index) + 1]
        features_VBCHW = torch.stack(self.encoder(torch.cat(images)).chunk(len(images)))
        height, width = views.left_BCHW.shape[-2:]
        return CalibratedMaps(
            features_VBCHW[index],
            views.K_B233[:, index].transpose(0, 1),
            views.camera_from_rig_B244[:, index].transpose(0, 1),
            width,
            height,
        )

    def decode(self, code: PixelStereoCode, points_BN3: Tensor) -> Tensor:
        """Logits ``(B, N)``."""
        at_once = max(1, SAMPLES // len(points_BN3))
        return torch.cat(
            [
                self.decoder(code.global_BC, self.token(code, some_BN3))
                for some_BN3 in torch.split(points_BN3, at_once, dim=1)
            ],
            dim=1,
        )

    def token(self, code: PixelStereoCode, points_BN3: Tensor) -> Tensor:
        """Evidence and place ``(B, N, T)`` of each point."""
        evidence_BNE = self.evidence(code.maps.features_VBCHW, code.maps.project(points_BN3))
        return torch.cat([evidence_BNE, positional_encoding(points_BN3, self.frequencies)], dim=-1)
