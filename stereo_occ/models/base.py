"""What every model takes and gives."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

#: Of all pairs together. A decoder 128 wide answers 80,000 points in 0.32 s in such pieces, in 0.79 s at once.
POINTS_IN_CACHE = 4096


@dataclass(frozen=True)
class StereoViews:
    """A batch of calibrated pairs.

    Attributes:
        left_BCHW, right_BCHW: RGB in [0, 1].
        K_B233: intrinsics of the left and the right camera, pixels.
        camera_from_rig_B244: extrinsics of the left and the right camera, metres.
    """

    left_BCHW: Tensor
    right_BCHW: Tensor
    K_B233: Tensor
    camera_from_rig_B244: Tensor


class OccupancyModel(nn.Module):
    """An occupancy function conditioned on a stereo pair.

    ``encode`` looks at the images once; ``decode`` answers for any number of rig-frame points. In eval mode
    the answer for a point does not depend on which other points are asked.
    """

    @abstractmethod
    def encode(self, views: StereoViews) -> Any:
        """The conditioning code of each pair, in whatever form :meth:`decode` takes."""

    @abstractmethod
    def decode(self, code: Any, points_BN3: Tensor) -> Tensor:
        """Occupancy logits ``(B, N)`` of rig-frame points."""

    def guidance(self, code: Any, points_BN3: Tensor, occupied_BN: Tensor) -> Tensor:
        """What training adds to the loss of the logits: how wrong the code is about the points, a scalar."""
        return points_BN3.new_zeros(())

    def seen_depths(self, code: Any) -> Tensor | None:
        """Depth of what each view sees, along its optical axis less the rig's origin's, metres, ``(V, B, H, W)``.

        None of a model that does not look for it.
        """
        return None

    def decode_all(self, code: Any, points_BN3: Tensor) -> Tensor:
        """:meth:`decode` in pieces whose activations stay in the processor's cache; for eval mode."""
        piece = max(1, POINTS_IN_CACHE // len(points_BN3))
        return torch.cat(
            [self.decode(code, part_BN3) for part_BN3 in torch.split(points_BN3, piece, dim=1)], dim=1
        )

    def forward(self, views: StereoViews, points_BN3: Tensor) -> Tensor:
        """Occupancy logits ``(B, N)``."""
        return torch.as_tensor(self.decode(self.encode(views), points_BN3))
