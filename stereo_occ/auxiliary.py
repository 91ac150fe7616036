"""Auxiliary tasks: the encoder's features must also tell mask and depth. What learns it is not part of the model."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import adaptive_avg_pool2d, binary_cross_entropy_with_logits

from stereo_occ.data.batch import Batch

HIDDEN = 32  # channels


@dataclass
class AuxiliaryConfig:
    """Weights of the auxiliary losses beside the occupancy's; 0 leaves one out."""

    mask: float = 0.0  # binary cross entropy of the share of each cell that the object covers
    depth: float = 0.0  # mean error of the depth inside the mask, per metre
    surface: float = 0.0  # the same of the surface that the model itself finds, if it looks for it


class AuxiliaryHeads(nn.Module):
    """Mask logits and depths ``(M, H, W)`` of each cell of the encoder's maps ``(M, C, H, W)``.

    Depths are along the optical axis, relative to the rig's origin.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(channels, HIDDEN, 3, padding=1), nn.ReLU(inplace=True), nn.Conv2d(HIDDEN, 2, 1)
        )

    def forward(self, features_MCHW: Tensor) -> tuple[Tensor, Tensor]:
        """See the class."""
        mask_MHW, depth_MHW = self.layers(features_MCHW).float().unbind(1)
        return mask_MHW, depth_MHW


def auxiliary_losses(
    heads: AuxiliaryHeads, features_MCHW: Tensor, batch: Batch, seen_VBHW: Tensor | None = None
) -> dict[str, Tensor]:
    """Losses ``mask`` and ``depth`` of the maps of the left images, or of the left and then the right ones.

    Args:
        batch: with its images' truth, whose means over each cell are learnt.
        seen_VBHW: depths that the model itself finds, of the same cells; their loss is ``surface``.
    """
    assert batch.truth is not None
    views = len(features_MCHW) // len(batch)
    height, width = features_MCHW.shape[-2:]

    def cells(images_B2HW: Tensor) -> Tensor:
        return adaptive_avg_pool2d(images_B2HW[:, :views].transpose(0, 1).flatten(0, 1), (height, width))

    true_B2HW = batch.truth.depth_B2HW
    seen_MHW = cells((true_B2HW > 0).float())
    origin_B211 = batch.truth.origin_B2[:, :, None, None]
    sums_MHW = cells(torch.where(true_B2HW > 0, true_B2HW - origin_B211, 0))  # of the seen part of each cell

    def depth_loss(depth_MHW: Tensor) -> Tensor:
        return (seen_MHW * depth_MHW - sums_MHW).abs().sum() / seen_MHW.sum().clamp(min=1e-6)

    mask_MHW, depth_MHW = heads(features_MCHW)
    losses = {
        "mask": binary_cross_entropy_with_logits(mask_MHW, cells(batch.truth.mask_B2HW)),
        "depth": depth_loss(depth_MHW),
    }
    return losses if seen_VBHW is None else losses | {"surface": depth_loss(seen_VBHW.flatten(0, 1))}


@contextmanager
def outputs_of(module: nn.Module) -> Iterator[list[Tensor]]:
    """What ``module`` returns while the context lasts."""
    outputs: list[Tensor] = []
    handle = module.register_forward_hook(lambda _module, _inputs, output: outputs.append(output))
    try:
        yield outputs
    finally:
        handle.remove()
