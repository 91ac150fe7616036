"""Any convolutional backbone of the timm package, which is optional."""

from itertools import pairwise
from typing import Any

import torch
from torch import Tensor

from stereo_occ.errors import UserError
from stereo_occ.models.encoders import ImageEncoder, choose_stride
from stereo_occ.models.light import TopDown


class TimmEncoder(ImageEncoder):
    """Feature maps of a timm backbone merged back to a stride (Wightman, "PyTorch Image Models").

    Inputs are normalised as the weights expect; from scratch they are centred to [-1, 1].

    Args:
        stride: one the backbone has, for merged features; None for the last map's own.
        channels: of the merged features.
        backbone: name in ``timm.list_models()``, with the tag of its weights if it has several.
        pretrained: start from timm's weights.
        load_weights: False leaves them random but keeps their normalisation, for a state dict to follow.

    Raises:
        UserError: if timm is not installed, the backbone unknown, without maps at strides that double or without that
            stride, or if its weights can neither be found nor fetched.
    """

    image_multiple = 32
    network: Any
    mean_C11: Tensor
    std_C11: Tensor

    def __init__(
        self, *, stride: int | None, channels: int, backbone: str, pretrained: bool, load_weights: bool
    ) -> None:
        super().__init__()
        self.network = _create(backbone, pretrained and load_weights)
        info = self.network.feature_info
        strides, widths = info.reduction(), info.channels()
        if strides[-1] > self.image_multiple or any(coarse != 2 * fine for fine, coarse in pairwise(strides)):
            raise UserError(
                f"model.encoder.backbone={backbone}: has maps at strides {strides}; "
                f"choose a backbone whose strides double and end at {self.image_multiple} or before"
            )
        self.stride = choose_stride(f"timm's {backbone}", stride, strides)
        self.first = strides.index(self.stride)
        merge = self.first < len(strides) - 1
        self.channels = channels if merge else widths[-1]
        self.merge = TopDown(widths[self.first :], channels) if merge else None
        weights = self.network.pretrained_cfg if pretrained else {"mean": [0.5], "std": [0.5]}
        self.register_buffer("mean_C11", torch.tensor(weights["mean"])[:, None, None], persistent=False)
        self.register_buffer("std_C11", torch.tensor(weights["std"])[:, None, None], persistent=False)

    def forward(self, image_BCHW: Tensor) -> Tensor:
        """See :class:`ImageEncoder`."""
        maps = self.network((image_BCHW - self.mean_C11) / self.std_C11)[self.first :]
        if getattr(self.network, "output_fmt", "NCHW") == "NHWC":  # not every family says it
            maps = [features_BHWC.permute(0, 3, 1, 2) for features_BHWC in maps]
        merged_BCHW: Tensor = maps[-1] if self.merge is None else self.merge(maps)
        return merged_BCHW


def _create(backbone: str, pretrained: bool) -> Any:
    try:
        import timm
    except ImportError as error:
        raise UserError(
            "model/encoder=timm: the package timm is not installed; install it with pip install 'stereo-occ[timm]'"
        ) from error
    try:
        return timm.create_model(backbone, pretrained=pretrained, features_only=True)
    except Exception as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        remedy = "choose one of timm.list_models()"
        if pretrained:
            remedy += ", or train from scratch with model.encoder.pretrained=false"
        raise UserError(
            f"model.encoder.backbone={backbone}: timm cannot make it ({reason}); {remedy}"
        ) from error
