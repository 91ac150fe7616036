"""An occupancy decoder for points that bring their own evidence."""

from torch import Tensor, nn


class PointDecoder(nn.Module):
    """Residual blocks on each point's token, which every block is given anew, as is the code of its sample.

    Tokens enter as in pixelNeRF (Yu et al., CVPR 2021), codes as gains and biases that start at 1 and 0. There is no
    norm over points: an answer never depends on the others.

    Args:
        token_size: channels of the tokens.
        code_size: channels of the code.
        hidden: channels of the layers.
        blocks: residual blocks.
    """

    def __init__(self, token_size: int, code_size: int, *, hidden: int, blocks: int) -> None:
        super().__init__()
        self.inject = nn.Linear(token_size, hidden * blocks)
        self.modulate = nn.Linear(code_size, 2 * hidden * blocks)
        nn.init.zeros_(self.modulate.weight)
        nn.init.zeros_(self.modulate.bias)
        self.blocks = nn.ModuleList(
            nn.Sequential(
                nn.ReLU(inplace=True),
                nn.Linear(hidden, hidden),
                nn.ReLU(inplace=True),
                nn.Linear(hidden, hidden),
            )
            for _ in range(blocks)
        )
        self.head = nn.Sequential(nn.ReLU(inplace=True), nn.Linear(hidden, 1))

    def forward(self, code_BC: Tensor, token_BNT: Tensor) -> Tensor:
        """Code and tokens to logits ``(B, N)``, float32."""
        blocks = len(self.blocks)
        modulation_LB1H = self.modulate(code_BC)[:, None].chunk(2 * blocks, dim=-1)
        x_BNH = token_BNT.new_zeros(())
        for block, injected_BNH, gain_B1H, bias_B1H in zip(
            self.blocks,
            self.inject(token_BNT).chunk(blocks, dim=-1),
            modulation_LB1H[:blocks],
            modulation_LB1H[blocks:],
            strict=True,
        ):
            x_BNH = x_BNH + injected_BNH
            x_BNH = x_BNH + block(x_BNH * (1 + gain_B1H) + bias_B1H)
        logits_BN: Tensor = self.head(x_BNH).squeeze(-1).float()
        return logits_BN
