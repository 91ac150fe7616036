"""Trained weights through torchvision's own interface."""

import sys
from pathlib import Path
from pickle import UnpicklingError

import torch
from torch import nn
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


def load_pretrained(network: nn.Module, weights: WeightsEnum, key: str, remedy: str) -> None:
    """Give a network its weights, from torch's cache or else from the network.

    Args:
        key: of the setting that asks for it.
        remedy: what else can be done.

    Raises:
        UserError: if they are in neither, or what is in the cache is not they.
    """
    cached = Path(torch.hub.get_dir()) / "checkpoints" / weights.url.rsplit("/", 1)[-1]
    try:
        state = weights.get_state_dict(progress=sys.stderr.isatty(), check_hash=True, weights_only=True)
        network.load_state_dict(dict(state))
    except (OSError, RuntimeError, EOFError, UnpicklingError, AttributeError, TypeError, ValueError) as error:
        if cached.is_file():
            raise UserError(
                f"{key}: {cached} does not hold {weights.name}; delete it, or {remedy}"
            ) from error
        reason = str(error).partition("\n")[0]
        raise UserError(
            f"{key}: {weights.name} is not at {cached} and cannot be fetched ({reason}); put the file there, or "
            f"{remedy}"
        ) from error
