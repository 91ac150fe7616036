"""Trained weights through torchvision's own interface."""

import sys
from pathlib import Path
from typing import Any

import torch
from torchvision.models import ResNet18_Weights, WeightsEnum

from stereo_occ.errors import UserError


def named_weights(name: str) -> ResNet18_Weights:
    """torchvision's ResNet-18 weights of that name.

    Raises:
        UserError: if there are none.
    """
    if name not in ResNet18_Weights.__members__:
        raise UserError(
            f"model.encoder.weights: unknown {name!r}; use {' or '.join(ResNet18_Weights.__members__)}, "
            "or null to train from scratch"
        )
    return ResNet18_Weights[name]


def fetch(weights: WeightsEnum, key: str, remedy: str) -> dict[str, Any]:
    """The state dict, from torch's cache or else from the network.

    Args:
        key: of the setting that asks for it.
        remedy: what else can be done.

    Raises:
        UserError: if it is in neither.
    """
    cached = Path(torch.hub.get_dir()) / "checkpoints" / weights.url.rsplit("/", 1)[-1]
    try:
        return dict(weights.get_state_dict(progress=sys.stderr.isatty(), check_hash=True, weights_only=True))
    except (OSError, RuntimeError) as error:
        raise UserError(
            f"{key}: {weights} is not at {cached} and cannot be fetched ({error}); put the file there, or {remedy}"
        ) from error
