"""Controls: the same network, data and schedule, with something taken from the second view.

What a network gains from a pair shows only beside a twin that has the same parameters and lacks the pair. A control
changes every view in one way for ever, in training and in evaluation, whatever the model and whoever is in its batch.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import Tensor

from stereo_occ.data.batch import Batch, ViewId, map_tensors


@dataclass
class ControlConfig:
    """What is taken from the pair, in training and evaluation alike."""

    name: str = "none"
    degrees: float = 0.0  # of calibration_off: angle between the right camera and what is said of it


def controlled(config: ControlConfig, batch: Batch) -> Batch:
    """What a network under the control sees of ``batch``; the same whenever it is asked."""
    return CONTROLS[config.name](batch, config.degrees)


def right_item(config: ControlConfig, item: int, objects: int, views: int) -> int:
    """The item whose right image stands beside the left one of ``item``.

    It is the item itself, but under ``right_shuffled`` the same view of another object, any one as likely. Items are
    numbered object by object.
    """
    if config.name != "right_shuffled":
        return item
    distance = int(np.random.default_rng(item).integers(1, objects))
    return (item + distance * views) % (objects * views)


def _none(batch: Batch, _degrees: float) -> Batch:
    return batch


def _right_zeroed(batch: Batch, _degrees: float) -> Batch:
    """A black right image; both cameras are known."""
    return _with_right_image(batch, lambda _left, right: torch.zeros_like(right))


def _left_twice(batch: Batch, _degrees: float) -> Batch:
    """The left image and the left camera in the place of the right ones."""
    twice = _with_right_image(batch, lambda left, _right: left)
    views = twice.views
    cameras = {
        "K_B233": views.K_B233[:, [0, 0]],
        "camera_from_rig_B244": views.camera_from_rig_B244[:, [0, 0]],
    }
    return replace(twice, views=replace(views, **cameras))


def _calibration_off(batch: Batch, degrees: float) -> Batch:
    """The right camera said to be turned about its centre, around another axis in each view."""
    extrinsics_B244 = batch.views.camera_from_rig_B244.clone()
    turns_B33 = Rotation.from_rotvec(degrees * axes_of(batch.ids), degrees=True).as_matrix()
    extrinsics_B244[:, 1, :3] = torch.as_tensor(turns_B33).to(extrinsics_B244) @ extrinsics_B244[:, 1, :3]
    return replace(batch, views=replace(batch.views, camera_from_rig_B244=extrinsics_B244))


CONTROLS: dict[str, Callable[[Batch, float], Batch]] = {
    "none": _none,
    "right_zeroed": _right_zeroed,
    "left_twice": _left_twice,
    "right_shuffled": _none,  # the images are exchanged before: right_item
    "calibration_off": _calibration_off,
}


def axes_of(ids: Sequence[ViewId]) -> NDArray[np.float64]:
    """Unit vectors ``(B, 3)``, uniform on the sphere; each view has its own for ever."""
    names = [f"{view.category}/{view.object_id}/{view.view}".encode() for view in ids]
    axes_B3 = np.stack([np.random.default_rng(crc32(name)).standard_normal(3) for name in names])
    return np.asarray(axes_B3 / np.linalg.norm(axes_B3, axis=1, keepdims=True))


def _with_right_image(batch: Batch, right_of: Callable[[Tensor, Tensor], Tensor]) -> Batch:
    """The batch with a right image, and its truth, made of the left and the right one."""
    views, truth = batch.views, batch.truth

    def pair(of_both: Tensor) -> Tensor:
        left, right = of_both.unbind(1)
        return torch.stack([left, right_of(left, right)], dim=1)

    return replace(
        batch,
        views=replace(views, right_BCHW=right_of(views.left_BCHW, views.right_BCHW)),
        truth=truth and map_tensors(truth, pair),
    )
