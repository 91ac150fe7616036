"""An exponential moving average of the weights: what is validated, saved as the model and evaluated.

Training goes on with its own weights, which checkpoints hold beside the average so that a run can go on.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import get_ema_multi_avg_fn


@dataclass
class AveragingConfig:
    """Moving average of the weights."""

    decay: float | None = None  # share of the former average that each step keeps; null: no average


class WeightAverage:
    """The average of a model's weights over the steps of its training.

    Step ``t`` keeps the share ``min(decay, (1 + t) / (10 + t))`` of the former average, so that the random start is
    soon forgotten. Running statistics of batch norm are averaged like weights; whole numbers are copied.

    Attributes:
        in_use: whether the model has the average for its weights at the moment.
    """

    def __init__(self, model: nn.Module, decay: float) -> None:
        self.model = model
        self.decay = decay
        self.in_use = False
        self._resting = {name: tensor.clone() for name, tensor in model.state_dict().items()}

    def to(self, device: torch.device) -> None:
        """Move the weights that the model does not have at the moment."""
        self._resting = {name: tensor.to(device) for name, tensor in self._resting.items()}

    @torch.no_grad()
    def update(self, step: int) -> None:
        """Take in the weights after ``step``, the first of which is 0."""
        keep = min(self.decay, (1 + step) / (10 + step))
        pairs = [(self._resting[name], tensor) for name, tensor in self.model.state_dict().items()]
        averages, weights = zip(*(pair for pair in pairs if pair[1].is_floating_point()), strict=True)
        get_ema_multi_avg_fn(keep)(averages, weights, None)  # type: ignore[no-untyped-call]
        for average, weight in pairs:
            if not weight.is_floating_point():
                average.copy_(weight)

    @torch.no_grad()
    def swap(self) -> None:
        """Let the model's weights and the average change places."""
        for name, tensor in self.model.state_dict().items():
            former = tensor.clone()
            tensor.copy_(self._resting[name])
            self._resting[name].copy_(former)
        self.in_use = not self.in_use

    def state(self) -> tuple[Mapping[str, Tensor], Mapping[str, Tensor]]:
        """The average and the weights of the training, by name."""
        model: dict[str, Any] = self.model.state_dict()
        return (model, self._resting) if self.in_use else (self._resting, model)

    @torch.no_grad()
    def load(self, average: Mapping[str, Tensor]) -> None:
        """Go on from an average; the model's weights are left to the caller."""
        for name, tensor in self._resting.items():
            tensor.copy_(average[name])
