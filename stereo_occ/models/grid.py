"""Where a volume of cells lies: over the whole working cube, or around the object as two views show it."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import smooth_l1_loss

from stereo_occ.models.sampling import cell_centers

MARGIN = 1.25  # side of the grid around an object, in largest extents of the object
SMALLEST = 0.2  # side of a grid, metres
TOLERANCE = 0.02  # metres, and share of a side, where the loss of the locator turns from quadratic to linear


@dataclass(frozen=True)
class Grid:
    """A cube in the rig frame for each sample, metres: centre ``(B, 3)`` and side ``(B,)``."""

    center_B3: Tensor
    side_B: Tensor

    def to_rig(self, local_N3: Tensor) -> Tensor:
        """Points given in sides from the centre, -0.5 to 0.5 inside, to the rig frame ``(B, N, 3)``."""
        return self.center_B3[:, None] + self.side_B[:, None, None] * local_N3

    def to_local(self, points_BN3: Tensor) -> Tensor:
        """Inverse of :meth:`to_rig`."""
        return (points_BN3.float() - self.center_B3[:, None]) / self.side_B[:, None, None]

    def detach(self) -> "Grid":
        """The same, outside the graph."""
        return Grid(self.center_B3.detach(), self.side_B.detach())


def whole_cube(batch: int, device: torch.device) -> Grid:
    """The cube ``[-0.5, 0.5]^3`` for every sample."""
    return Grid(torch.zeros(batch, 3, device=device), torch.ones(batch, device=device))


class Locator(nn.Module):
    """Finds the grid around the object in a coarse volume over the working cube.

    A probability over the cells gives the centre as their mean and weighs the features that tell the size.

    Args:
        cells: of the coarse volume, per side.
        width: channels of the volume.
    """

    centers_N3: Tensor

    def __init__(self, cells: int, width: int) -> None:
        super().__init__()
        self.register_buffer("centers_N3", cell_centers(cells), persistent=False)
        self.layers = nn.Sequential(
            *_normalized_conv(width), *_normalized_conv(width), nn.BatchNorm3d(width), nn.ReLU()
        )
        self.attention = nn.Conv3d(width, 1, 1, bias=False)
        self.size = nn.Linear(width, 1)

    def forward(self, volume_BCDHW: Tensor) -> Grid:
        """Coarse volumes ``(B, width, cells, cells, cells)`` to grids."""
        features_BCDHW = self.layers(volume_BCDHW)
        weights_BN = self.attention(features_BCDHW).flatten(1).float().softmax(dim=1)
        with torch.autocast(weights_BN.device.type, enabled=False):
            center_B3 = weights_BN @ self.centers_N3
            pooled_BC = torch.einsum("bcn,bn->bc", features_BCDHW.flatten(2).float(), weights_BN)
            share_B = torch.sigmoid(self.size(pooled_BC)).squeeze(1)
        return Grid(center_B3, SMALLEST + (1 - SMALLEST) * share_B)


def locator_loss(grid: Grid, points_BN3: Tensor, occupied_BN: Tensor) -> Tensor:
    """How far grids are from the cubes around the occupied query points, sample by sample, averaged.

    The side that is asked for is ``MARGIN`` times the points' largest extent, at most 1. Samples without an occupied
    point count 0.
    """
    inside_BN1 = occupied_BN[..., None] > 0.5
    far = torch.finfo(torch.float32).max
    low_B3 = points_BN3.masked_fill(~inside_BN1, far).amin(dim=1)
    high_B3 = points_BN3.masked_fill(~inside_BN1, -far).amax(dim=1)
    known_B = inside_BN1.any(dim=1).squeeze(1).float()
    center_B3 = torch.where(known_B[:, None] > 0, (low_B3 + high_B3) / 2, grid.center_B3)
    side_B = (MARGIN * (high_B3 - low_B3).amax(dim=1)).clamp(SMALLEST, 1)
    centers_B = smooth_l1_loss(grid.center_B3, center_B3, beta=TOLERANCE, reduction="none").sum(dim=1)
    sides_B = smooth_l1_loss(grid.side_B.log(), side_B.log(), beta=TOLERANCE, reduction="none")
    return ((centers_B + sides_B) * known_B).mean()


def _normalized_conv(width: int) -> list[nn.Module]:
    return [nn.BatchNorm3d(width), nn.ReLU(), nn.Conv3d(width, width, 3, padding=1, bias=False)]
