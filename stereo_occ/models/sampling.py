"""Where rig-frame points are in each view, and the features there.

Here and in the modules that use it, V counts the views. Coordinates are float32 under autocast too: half precision
misses the right cell of a large map.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import grid_sample, normalize

from stereo_occ.geometry.camera import normalize_pixels, project

NEAREST = 0.05  # metres; what is not at least this far in front of a camera is not seen


@dataclass(frozen=True)
class Projections:
    """Points as V cameras see them.

    Attributes:
        positions_VBN2: where in the image, -1 and 1 at its outer edges; beyond them, up to -2 and 2.
        visible_VBN: 1 inside the image and in front of the camera, 0 elsewhere.
        offsets_VBN3: from the fixation point to the point along the camera's axes, metres.
        depths_VBN: along the optical axis, metres, at least ``NEAREST``.
    """

    positions_VBN2: Tensor
    visible_VBN: Tensor
    offsets_VBN3: Tensor
    depths_VBN: Tensor

    @property
    def shares_VBN(self) -> Tensor:
        """What each view counts for in a mean over those that see the point; 0 where none does."""
        return self.visible_VBN / self.visible_VBN.sum(dim=0).clamp(min=1)


def project_points(
    points_BN3: Tensor, K_VB33: Tensor, camera_from_rig_VB44: Tensor, width: int, height: int
) -> Projections:
    """Project rig-frame points, metres, with each sample's own cameras into images of that size in pixels."""
    with torch.autocast(points_BN3.device.type, enabled=False):
        points_BN3, camera_from_rig_VB44 = points_BN3.float(), camera_from_rig_VB44.float()
        pixels_VBN2, depths_VBN = project(points_BN3, K_VB33.float(), camera_from_rig_VB44)
        in_front_VBN = depths_VBN >= NEAREST
        positions_VBN2 = normalize_pixels(pixels_VBN2, width, height)
        positions_VBN2 = torch.where(in_front_VBN[..., None], positions_VBN2, 2.0).clamp(-2, 2)
        visible_VBN = in_front_VBN & (positions_VBN2.abs() <= 1).all(dim=-1)
        offsets_VBN3 = points_BN3 @ camera_from_rig_VB44[..., :3, :3].mT
    return Projections(positions_VBN2, visible_VBN.float(), offsets_VBN3, depths_VBN.clamp(min=NEAREST))


def sample_maps(features_VBCHW: Tensor, positions_VBN2: Tensor) -> Tensor:
    """Features ``(V, B, C, N)`` at positions of maps of any stride, bilinear; the edge's own beyond it.

    Interpolated in float32, returned in the type of the maps.
    """
    V, B, N, _ = positions_VBN2.shape
    samples_MCN1 = grid_sample(
        features_VBCHW.float().flatten(0, 1),
        positions_VBN2.view(V * B, N, 1, 2),
        padding_mode="border",
        align_corners=False,
    )
    return samples_MCN1.view(V, B, samples_MCN1.shape[1], N).to(features_VBCHW.dtype)


def cell_centers(cells: int) -> Tensor:
    """Centres ``(cells^3, 3)`` of a grid's cells, in its sides from its centre; z outermost, x innermost."""
    centers = (torch.arange(cells) + 0.5) / cells - 0.5
    z, y, x = torch.meshgrid(centers, centers, centers, indexing="ij")
    return torch.stack([x, y, z], dim=-1).view(-1, 3)


def sample_volume(volume_BCDHW: Tensor, points_BN3: Tensor) -> Tensor:
    """Features ``(B, C, N)`` of a volume over the grid of :func:`cell_centers`, trilinear, as :func:`sample_maps`.

    Points are in sides of the grid from its centre, as the cells' centres are.
    """
    B, N, _ = points_BN3.shape
    samples_BCN11 = grid_sample(
        volume_BCDHW.float(),
        2 * points_BN3.float().view(B, N, 1, 1, 3),
        padding_mode="border",
        align_corners=False,
    )
    return samples_BCN11.flatten(2).to(volume_BCDHW.dtype)


def cell_pixels(height: int, width: int, stride: int, device: torch.device) -> Tensor:
    """Homogeneous pixels ``(height * width, 3)`` of the centres of a map's cells, row by row."""
    u, v = (stride * torch.arange(n, device=device) + (stride - 1) / 2 for n in (width, height))
    v_HW, u_HW = torch.meshgrid(v, u, indexing="ij")
    return torch.stack([u_HW, v_HW, torch.ones_like(u_HW)], dim=-1).view(-1, 3)


def cell_rays(
    K_VB33: Tensor, camera_from_rig_VB44: Tensor, height: int, width: int, stride: int
) -> tuple[Tensor, Tensor]:
    """Lines of sight through a map's cells, rig frame.

    Args:
        height, width: of the map.
        stride: image pixels per cell.

    Returns:
        Centres of the cameras ``(V, B, 1, 3)``, metres, and directions ``(V, B, height * width, 3)`` that go one metre
        along the optical axis.
    """
    with torch.autocast(K_VB33.device.type, enabled=False):
        pixels_P3 = cell_pixels(height, width, stride, K_VB33.device)
        R_VB33, t_VB3 = camera_from_rig_VB44[..., :3, :3].float(), camera_from_rig_VB44[..., :3, 3].float()
        directions_VBP3 = pixels_P3 @ torch.linalg.inv(K_VB33.float()).mT @ R_VB33
        return -(t_VB3[..., None, :] @ R_VB33), directions_VBP3


def ray_maps(centers_VB13: Tensor, directions_VBP3: Tensor) -> Tensor:
    """Pluecker coordinates ``(V, B, 6, P)`` of lines of sight.

    The unit direction in the rig frame, then the moment about the fixation point, metres: with them a map says where
    its camera is (Sitzmann et al., "Light Field Networks", NeurIPS 2021).
    """
    directions_VBP3 = normalize(directions_VBP3, dim=-1)
    moments_VBP3 = torch.linalg.cross(centers_VB13.expand_as(directions_VBP3), directions_VBP3)
    return torch.cat([directions_VBP3, moments_VBP3], dim=-1).mT
