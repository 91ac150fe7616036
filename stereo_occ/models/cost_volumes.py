"""Cost volumes: left features against right features, at a range of disparities or of depths."""

from abc import abstractmethod
from collections.abc import Sequence
from math import ceil, floor

import torch
from torch import Tensor, nn
from torch.nn.functional import pad

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.models.base import StereoViews
from stereo_occ.models.disparity import disparity_range
from stereo_occ.models.sampling import NEAREST, cell_pixels, project_points, sample_maps

WORKING_RADIUS = 0.5  # metres about the fixation point: the sphere about a unit-diagonal object


class CostVolume(nn.Module):
    """Maps left and right features to a volume.

    Attributes:
        slices: along the volume's third axis.
        out_channels: of the volume.
    """

    slices: int
    out_channels: int

    @abstractmethod
    def forward(self, left_BCHW: Tensor, right_BCHW: Tensor, views: StereoViews) -> Tensor:
        """Volume ``(B, out_channels, slices, H, W)`` of the features of ``views``, cells of the left map.

        In float32 under autocast too, where half precision loses matches.
        """


class DisparityVolume(CostVolume):
    """A slice per disparity, in whole feature cells; the cameras are not looked at.

    At disparity d the left cell u meets the right cell ``u - d``; where that lies outside the right image, the volume
    is 0.

    Args:
        disparities: of the slices, consecutive.
    """

    def __init__(self, disparities: Sequence[int]) -> None:
        super().__init__()
        self.disparities = tuple(disparities)
        self.slices = len(self.disparities)

    def forward(self, left_BCHW: Tensor, right_BCHW: Tensor, views: StereoViews) -> Tensor:
        """See :class:`CostVolume`."""
        return self.compare(left_BCHW.float()[:, :, None], shift(right_BCHW.float(), self.disparities))

    @abstractmethod
    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """The volume from left features and shifted right features."""


class Correlation(DisparityVolume):
    """Channel-wise products, not summed: the paper's four-dimensional volume."""

    def __init__(self, channels: int, *, disparities: Sequence[int]) -> None:
        super().__init__(disparities)
        self.out_channels = channels

    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """See :class:`DisparityVolume`."""
        return left_BC1HW * right_BCDHW


class Groupwise(DisparityVolume):
    """Products averaged over groups of channels (Guo et al., GwcNet, CVPR 2019).

    Raises:
        UserError: if the groups do not divide the channels.
    """

    def __init__(self, channels: int, *, disparities: Sequence[int], groups: int) -> None:
        super().__init__(disparities)
        if groups < 1 or channels % groups:
            raise UserError(
                f"model.cost_volume.groups: must divide the encoder's {channels} channels, got {groups}"
            )
        self.out_channels = groups

    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """See :class:`DisparityVolume`."""
        products_BCDHW = left_BC1HW * right_BCDHW
        B, _, *DHW = products_BCDHW.shape
        return products_BCDHW.reshape(B, self.out_channels, -1, *DHW).mean(dim=2)


class Concat(DisparityVolume):
    """Left features beside shifted right features (Chang and Chen, PSMNet, CVPR 2018)."""

    def __init__(self, channels: int, *, disparities: Sequence[int]) -> None:
        super().__init__(disparities)
        self.out_channels = 2 * channels

    def compare(self, left_BC1HW: Tensor, right_BCDHW: Tensor) -> Tensor:
        """See :class:`DisparityVolume`."""
        inside_DHW = shift(torch.ones_like(right_BCDHW[:1, :1, 0]), self.disparities)[0]
        return torch.cat([left_BC1HW * inside_DHW, right_BCDHW], dim=1)


class PlaneSweep(CostVolume):
    """Products of left features with the right ones that the cameras given put behind them (Yao et al., MVSNet, 2018).

    A slice per plane in front of the left camera, at depths evenly spaced in their inverse over the working ball. Where
    a point of a plane is not in the right image, the volume is 0.

    Args:
        channels: of the features.
        planes: slices of the volume.
    """

    def __init__(self, channels: int, *, planes: int) -> None:
        super().__init__()
        self.slices = planes
        self.out_channels = channels

    def forward(self, left_BCHW: Tensor, right_BCHW: Tensor, views: StereoViews) -> Tensor:
        """See :class:`CostVolume`."""
        B, C, H, W = left_BCHW.shape
        height, width = views.left_BCHW.shape[-2:]
        points_BN3 = sweep_points(
            views.K_B233[:, 0],
            views.camera_from_rig_B244[:, 0],
            self.slices,
            H,
            W,
            width // W,
        )
        right = project_points(
            points_BN3, views.K_B233[None, :, 1], views.camera_from_rig_B244[None, :, 1], width, height
        )
        warped_BCN = (
            sample_maps(right_BCHW[None].float(), right.positions_VBN2)[0] * right.visible_VBN[0, :, None]
        )
        return left_BCHW.float()[:, :, None] * warped_BCN.view(B, C, self.slices, H, W)


def sweep_points(
    K_B33: Tensor, camera_from_rig_B44: Tensor, planes: int, height: int, width: int, stride: int
) -> Tensor:
    """Where the lines of sight of a map's cells meet planes through the working ball.

    The planes are parallel to the image; the fixation point's depth plus and minus ``WORKING_RADIUS`` are the last and
    the first, and their inverse depths are evenly spaced.

    Args:
        height, width: of the map.
        stride: image pixels per cell.

    Returns:
        ``(B, planes * height * width, 3)``, rig frame, metres; the planes outermost, then the rows.
    """
    with torch.autocast(K_B33.device.type, enabled=False):
        K_B33, camera_from_rig_B44 = K_B33.float(), camera_from_rig_B44.float()
        R_B33, t_B3 = camera_from_rig_B44[:, :3, :3], camera_from_rig_B44[:, :3, 3]
        near_B, far_B = (t_B3[:, 2] - WORKING_RADIUS).clamp(min=NEAREST), t_B3[:, 2] + WORKING_RADIUS
        share_D = torch.linspace(0, 1, planes, device=K_B33.device)
        depths_BD = 1 / torch.lerp(1 / near_B[:, None], 1 / far_B[:, None], share_D)
        rays_BP3 = cell_pixels(height, width, stride, K_B33.device) @ torch.linalg.inv(K_B33).mT
        local_BN3 = (depths_BD[:, :, None, None] * rays_BP3[:, None]).flatten(1, 2)
        points_BN3: Tensor = (local_BN3 - t_B3[:, None]) @ R_B33
        return points_BN3


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
