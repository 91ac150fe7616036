"""From which probability on a point counts as inside.

One threshold for all pairs is too high for those of which little is sure, a thin wall far away, and too low for the
others. Were the errors at different points independent, the expected IoU would be highest for the points whose odds
are above that IoU itself (Lipton, Elkan and Naryanaswamy, ECML 2014, who have half of the highest F1: the same). A wall
errs as a whole, so a factor remains to be chosen on validation objects, as one threshold for all would be.
"""

from dataclasses import dataclass
from enum import Enum

import torch
from torch import Tensor

#: Pairs of which less can be expected are answered as if it were this much, so that nothing may be found in them.
LEAST = 0.05


class DecisionRule(Enum):
    """What the threshold refers to."""

    fixed = "fixed"  # the probability, of every pair
    relative = "relative"  # the odds, divided by the IoU that can be expected of the pair, as a probability


@dataclass(frozen=True)
class Decision:
    """The threshold ``(0, 1)`` and what it refers to."""

    threshold: float
    rule: DecisionRule = DecisionRule.fixed

    def thresholds(self, cube_BN: Tensor) -> Tensor:
        """The decision thresholds on the probability ``(B,)`` of pairs.

        Args:
            cube_BN: logits of points spread evenly over the working cube.
        """
        return self.shifted(level_shift(self.rule, cube_BN).cpu())

    def shifted(self, shift_B: Tensor) -> Tensor:
        """The decision thresholds ``(B,)`` from what :func:`level_shift` says of the pairs."""
        return torch.sigmoid(torch.logit(torch.tensor(self.threshold, dtype=torch.float64)) + shift_B)


def level_shift(rule: DecisionRule, cube_BN: Tensor) -> Tensor:
    """By how much the logit of the threshold is raised for each pair ``(B,)``.

    Args:
        cube_BN: as for :meth:`Decision.thresholds`; pairs with a NaN have failed, and are not raised.
    """
    if rule is DecisionRule.fixed:
        return torch.zeros(len(cube_BN), dtype=torch.float64, device=cube_BN.device)
    return highest_expected_iou(cube_BN).nan_to_num(1.0).clamp(min=LEAST).log()


def highest_expected_iou(logits_BN: Tensor) -> Tensor:
    """The IoU ``(B,)`` that the best choice of points can expect: of sums, were the points independent."""
    probability_BN = logits_BN.double().sigmoid().sort(dim=1, descending=True).values
    inside_BN = probability_BN.cumsum(dim=1)
    chosen_N = torch.arange(1, logits_BN.shape[1] + 1, device=logits_BN.device)
    union_BN = chosen_N + inside_BN[:, -1:] - inside_BN
    return (inside_BN / union_BN).max(dim=1).values
