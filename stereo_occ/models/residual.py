"""Pre-activation residual blocks."""

from collections.abc import Callable

from torch import Tensor, nn
from torch.nn.functional import conv2d

Activation = Callable[[Tensor], Tensor]


class NormActivation(nn.Module):
    """Batch norm and an activation that may work in place."""

    def __init__(self, channels: int, activation: Activation) -> None:
        super().__init__()
        self.norm = nn.BatchNorm2d(channels)
        self.activation = activation

    def forward(self, x_BCHW: Tensor) -> Tensor:
        """Same shape."""
        return self.activation(self.norm(x_BCHW))


class DilatedConv(nn.Conv2d):
    """A 3x3 convolution that keeps the resolution.

    On a map no larger than the dilation all taps but the middle one meet only padding. They are left out: the same
    result for a ninth of the work, and no gradient for those weights either way.
    """

    def __init__(self, in_channels: int, channels: int, dilation: int) -> None:
        super().__init__(in_channels, channels, 3, padding=dilation, dilation=dilation, bias=False)

    def forward(self, x_BCHW: Tensor) -> Tensor:
        """``(B, in_channels, H, W)`` to ``(B, channels, H, W)``."""
        if max(x_BCHW.shape[2:]) <= self.dilation[0]:
            return conv2d(x_BCHW, self.weight[:, :, 1:2, 1:2])
        return super().forward(x_BCHW)


class ResidualBlock(nn.Module):
    """Two 3x3 convolutions, each after batch norm and activation, beside a shortcut (He et al., ECCV 2016).

    The output is not activated. The shortcut is the identity, or a 1x1 convolution where the width changes.
    """

    def __init__(self, in_channels: int, channels: int, dilation: int, activation: Activation) -> None:
        super().__init__()
        self.norm0 = NormActivation(in_channels, activation)
        self.conv0 = DilatedConv(in_channels, channels, dilation)
        self.norm1 = NormActivation(channels, activation)
        self.conv1 = DilatedConv(channels, channels, dilation)
        self.shortcut = (
            nn.Identity() if in_channels == channels else nn.Conv2d(in_channels, channels, 1, bias=False)
        )

    def forward(self, x_BCHW: Tensor) -> Tensor:
        """``(B, in_channels, H, W)`` to ``(B, channels, H, W)``."""
        residual: Tensor = self.conv1(self.norm1(self.conv0(self.norm0(x_BCHW))))
        return residual.add_(self.shortcut(x_BCHW))
