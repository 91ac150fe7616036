"""What a loader gives: named fields, rig frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Self, TypeVar, cast

import torch
from torch import Tensor

from stereo_occ.models.base import StereoViews

T = TypeVar("T")


@dataclass(frozen=True)
class Queries:
    """Labelled points of a batch: rig frame ``(B, N, 3)``, occupancy ``(B, N)`` as 0 and 1."""

    points_BN3: Tensor
    occupied_BN: Tensor


@dataclass(frozen=True)
class ImageTruth:
    """What the images show, whatever a network is told of their cameras.

    Attributes:
        mask_B2HW: share of each pixel that is the object.
        depth_B2HW: along the optical axis in the rig's unit, 0 for background.
        origin_B2: depth of the rig's origin.
    """

    mask_B2HW: Tensor
    depth_B2HW: Tensor
    origin_B2: Tensor


@dataclass(frozen=True)
class ViewId:
    """Which picture of which object."""

    category: str
    object_id: str
    view: int


@dataclass(frozen=True)
class Batch:
    """Stereo pairs with named sets of labelled points.

    Attributes:
        queries: ``train`` for training; ``bbox``, ``cube`` and ``unposed`` for evaluation.
        truth: of the images, where it was asked for.
    """

    views: StereoViews
    queries: Mapping[str, Queries]
    ids: list[ViewId]
    truth: ImageTruth | None = None

    def to(self, device: torch.device | str) -> Self:
        """The same batch on another device."""
        return map_tensors(self, lambda tensor: tensor.to(device, non_blocking=True))

    def __len__(self) -> int:
        return len(self.ids)


def map_tensors(value: T, function: Callable[[Tensor], Tensor]) -> T:
    """Apply ``function`` to every tensor in nested dataclasses and mappings."""
    result: Any = value
    if isinstance(value, Tensor):
        result = function(value)
    elif isinstance(value, Mapping):
        result = {key: map_tensors(item, function) for key, item in value.items()}
    elif is_dataclass(value) and not isinstance(value, type):
        result = type(value)(**{f.name: map_tensors(getattr(value, f.name), function) for f in fields(value)})
    return cast(T, result)
