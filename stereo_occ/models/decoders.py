"""The occupancy network's decoder (Mescheder et al., "Occupancy Networks", CVPR 2019)."""

from collections.abc import Iterator

import torch
from torch import Tensor, nn


class ConditionalBatchNorm(nn.Module):
    """Batch norm over all points of all samples, then each sample's own gain and bias, then ReLU."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm = nn.BatchNorm1d(channels, affine=False)

    def forward(self, x_BNC: Tensor, gain_B1C: Tensor, bias_B1C: Tensor) -> Tensor:
        """Same shape. In eval mode the norm is folded into gain and bias."""
        if self.training:
            x_BNC = self.norm(x_BNC.flatten(0, 1)).view_as(x_BNC)
        else:
            mean_C, variance_C = self.norm.get_buffer("running_mean"), self.norm.get_buffer("running_var")
            gain_B1C = gain_B1C * torch.rsqrt(variance_C + self.norm.eps)
            bias_B1C = bias_B1C - gain_B1C * mean_C
        return (x_BNC * gain_B1C.to(x_BNC)).add_(bias_B1C.to(x_BNC)).relu_()  # addcmul has a slower backward


class ConditionalBlock(nn.Module):
    """``x + fc1(relu(cbn1(fc0(relu(cbn0(x))))))``; the identity at first, since fc1 starts at 0."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm0, self.norm1 = ConditionalBatchNorm(channels), ConditionalBatchNorm(channels)
        self.fc0 = nn.Linear(channels, channels, bias=False)
        self.fc1 = nn.Linear(channels, channels, bias=False)
        nn.init.zeros_(self.fc1.weight)

    def forward(self, x_BNC: Tensor, modulation: Iterator[Tensor]) -> Tensor:
        """Same shape; takes two pairs ``(2, B, 1, C)`` of gain and bias from ``modulation``."""
        hidden_BNC = self.fc0(self.norm0(x_BNC, *next(modulation)))
        residual_BNC: Tensor = self.fc1(self.norm1(hidden_BNC, *next(modulation)))
        return residual_BNC.add_(x_BNC)


class ONet(nn.Module):
    """Occupancy logits of points, given each sample's code.

    All gains and biases come from one linear map of the code, with weights that start at 0. Layers before a
    batch norm have no bias of their own, for the norm would take it away again.

    Args:
        code_size: channels of the code.
        hidden: channels of the layers.
        blocks: residual blocks.
    """

    def __init__(self, code_size: int, *, hidden: int, blocks: int) -> None:
        super().__init__()
        self.embed = nn.Linear(3, hidden, bias=False)
        self.blocks = nn.ModuleList(ConditionalBlock(hidden) for _ in range(blocks))
        self.norm = ConditionalBatchNorm(hidden)
        self.head = nn.Linear(hidden, 1)
        self.modulate = nn.Linear(code_size, 2 * hidden * (2 * blocks + 1))
        nn.init.zeros_(self.modulate.weight)
        with torch.no_grad():
            gains, biases = self.modulate.bias.view(-1, 2, hidden).unbind(1)
            gains.fill_(1)
            biases.zero_()

    def forward(self, code_BC: Tensor, points_BN3: Tensor) -> Tensor:
        """Code and rig-frame points, metres, to logits ``(B, N)``."""
        modulation_BL21C = (
            self.modulate(code_BC).float().view(len(code_BC), -1, 2, 1, self.embed.out_features)
        )
        modulation = iter(modulation_BL21C.permute(1, 2, 0, 3, 4))
        x_BNC = self.embed(points_BN3)
        for block in self.blocks:
            x_BNC = block(x_BNC, modulation)
        logits_BN: Tensor = self.head(self.norm(x_BNC, *next(modulation))).squeeze(-1).float()
        return logits_BN
