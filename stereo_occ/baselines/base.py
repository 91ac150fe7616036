"""What the baselines share: from a field of probabilities to logits and a mesh."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import log

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from trimesh import Trimesh

from stereo_occ.decision import Decision
from stereo_occ.meshing import sample_field
from stereo_occ.models.base import StereoViews
from stereo_occ.predictors import ObjectView

#: Occupancy probabilities ``(N,)`` of rig-frame points ``(N, 3)``.
Field = Callable[[NDArray[np.float64]], NDArray[np.float64]]

#: Probabilities are kept this far from 0 and 1, so that logits are finite and surfaces between them interpolated.
_MARGIN = 1e-4


class Baseline(ABC):
    """A predictor that looks at a view once and then answers for any points."""

    decision = Decision(0.5)

    @abstractmethod
    def look(self, view: ObjectView) -> Field:
        """The occupancy of one view."""

    def logits(
        self, views: Sequence[ObjectView], pictures: StereoViews, points: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """Occupancy logits ``(B, N)`` of each named set of rig-frame points ``(B, N, 3)``."""
        fields = [self.look(view) for view in views]
        return {
            name: torch.stack(
                [
                    torch.from_numpy(_logits(field, points_N3.numpy().astype(np.float64)))
                    for field, points_N3 in zip(fields, points_BN3, strict=True)
                ]
            ).float()
            for name, points_BN3 in points.items()
        }

    def mesh(self, view: ObjectView, picture: StereoViews, resolution: int) -> Trimesh:
        """The surface at the decision threshold, rig frame; empty if there is none."""
        field = self.look(view)
        return sample_field(
            lambda points_N3: _logits(field, points_N3.astype(np.float64)),
            low=-0.5 * np.ones(3),
            high=0.5 * np.ones(3),
            resolution=resolution,
            level=log(self.decision.threshold / (1 - self.decision.threshold)),
        ).surface()


def _logits(field: Field, points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
    probability_N = field(points_N3).clip(_MARGIN, 1 - _MARGIN)
    return np.asarray(np.log(probability_N / (1 - probability_N)))
