"""Optimisers and learning-rate schedules by name."""

from math import cos, pi

from torch import nn
from torch.optim import Adam, AdamW, Optimizer
from torch.optim.lr_scheduler import LambdaLR

from stereo_occ.config import OptimizerConfig, SchedulerConfig

OPTIMIZERS: dict[str, type[Adam]] = {"adam": Adam, "adamw": AdamW}
SCHEDULES = ("constant", "cosine")


def build_optimizer(config: OptimizerConfig, model: nn.Module, fused: bool = True) -> Optimizer:
    """The optimiser of all parameters of ``model``.

    Args:
        fused: all in one pass, which is faster; in mixed precision Lightning clips no gradients for such an optimiser.
    """
    beta1, beta2 = config.betas
    return OPTIMIZERS[config.name](
        model.parameters(), lr=config.lr, betas=(beta1, beta2), weight_decay=config.weight_decay, fused=fused
    )


def build_schedule(config: SchedulerConfig, optimizer: Optimizer, steps: int) -> LambdaLR:
    """Linear warm-up, then constant or half a cosine down to ``final`` times the learning rate at ``steps``."""

    def factor(step: int) -> float:
        if step < config.warmup:
            return (step + 1) / (config.warmup + 1)
        if config.name == "constant":
            return 1.0
        progress = min(1.0, (step - config.warmup) / max(1, steps - config.warmup))
        return config.final + (1 - config.final) * (1 + cos(pi * progress)) / 2

    return LambdaLR(optimizer, factor)
