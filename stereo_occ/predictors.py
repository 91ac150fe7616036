"""What an evaluation can measure: anything that answers where an object is, given one of its views."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor
from trimesh import Trimesh

from stereo_occ.data.batch import map_tensors
from stereo_occ.data.shard import Shard
from stereo_occ.decision import Decision
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.geometry.pose import Pose
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.precision import chosen_precision, on_gpu
from stereo_occ.reconstruction import reconstruct

_PRECISION = {"32-true": None, "bf16-mixed": torch.bfloat16, "16-mixed": torch.float16}


@dataclass(frozen=True)
class ObjectView:
    """One view of one object, with all that its shard knows: pictures, masks and the true pose and mesh."""

    shard: Shard
    view: int

    @property
    def pose(self) -> Pose:
        """The object's true pose."""
        return self.shard.pose(self.view)

    @property
    def rig(self) -> StereoRig:
        """The cameras that a model is told."""
        height, width = self.shard.mask(self.view).shape[1:]
        left, right = (
            Camera(K_33, camera_44, width, height)
            for K_33, camera_44 in zip(*self.shard.cameras(self.view), strict=True)
        )
        return StereoRig(left, right)


class Predictor(Protocol):
    """Occupancy of views.

    Attributes:
        decision: from which probability on a point counts as inside.
    """

    decision: Decision

    def logits(
        self, views: Sequence[ObjectView], pictures: StereoViews, points: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """Occupancy logits ``(B, N)`` of each named set of rig-frame points ``(B, N, 3)``.

        Args:
            pictures: those of ``views``, with their cameras.
        """

    def mesh(self, view: ObjectView, picture: StereoViews, resolution: int) -> Trimesh:
        """The surface at the decision threshold, rig frame; empty if there is none.

        Args:
            picture: of the view (``B = 1``).
            resolution: cells along each side of the working cube.
        """


class LearnedPredictor:
    """A trained network: it sees the pictures and their cameras, and nothing else."""

    def __init__(self, model: OccupancyModel, decision: Decision, accelerator: str, precision: str) -> None:
        self.device = torch.device("cuda" if on_gpu(accelerator) else "cpu")
        self.model = model.to(self.device).eval()
        self.decision = decision
        self.precision = chosen_precision(precision, accelerator)

    def logits(
        self, views: Sequence[ObjectView], pictures: StereoViews, points: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """See :class:`Predictor`."""
        with torch.inference_mode(), self._autocast():
            code = self.model.encode(map_tensors(pictures, lambda tensor: tensor.to(self.device)))
            return {
                name: self.model.decode_all(code, points_BN3.to(self.device)).float().cpu()
                for name, points_BN3 in points.items()
            }

    def mesh(self, view: ObjectView, picture: StereoViews, resolution: int) -> Trimesh:
        """See :class:`Predictor`."""
        with self._autocast():
            pictures = map_tensors(picture, lambda tensor: tensor.to(self.device))
            return reconstruct(self.model, pictures, self.decision, resolution)

    @contextmanager
    def _autocast(self) -> Iterator[None]:
        dtype = _PRECISION[self.precision]
        with torch.autocast(self.device.type, dtype, enabled=dtype is not None):
            yield
