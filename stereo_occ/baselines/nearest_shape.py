"""The nearest training shape at the true pose: what a perfect retrieval and a perfect pose would give.

No floor but a ceiling of recognition: it is told which training object is most like the true one, and where it is.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm
from trimesh import Trimesh

from stereo_occ.baselines.base import Baseline, Field
from stereo_occ.data.shard import Shard
from stereo_occ.models.base import StereoViews
from stereo_occ.occupancy.contains import contains
from stereo_occ.predictors import ObjectView


class NearestShape(Baseline):
    """The training object with the highest IoU with the true one in the object frame.

    Args:
        training: shards of the objects to choose from.
        cells: per side of the grid over ``[-0.5, 0.5]^3`` on which objects are compared.
    """

    def __init__(self, training: Sequence[Shard], cells: int, progress: bool = False) -> None:
        self.training = training
        self.cells = cells
        bars = tqdm(training, desc="training shapes", unit="object", disable=not progress)
        self._occupied_TN = np.stack([grid_occupancy(shard.mesh, cells) for shard in bars])
        self._nearest = lru_cache(maxsize=16)(self._find)

    def nearest(self, shard: Shard) -> Shard:
        """The training object most like that of ``shard``."""
        return self.training[self._nearest(shard)]

    def _find(self, shard: Shard) -> int:
        occupied_N = grid_occupancy(shard.mesh, self.cells)
        intersection_T = (self._occupied_TN & occupied_N).sum(axis=1)
        union_T = (self._occupied_TN | occupied_N).sum(axis=1)
        return int((intersection_T / np.maximum(union_T, 1)).argmax())

    def look(self, view: ObjectView) -> Field:
        """Inside or outside of the chosen object, posed."""
        mesh, pose = self.nearest(view.shard).mesh, view.pose

        def field(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
            return contains(mesh, pose.to_object(points_N3)).astype(np.float64)

        return field

    def mesh(self, view: ObjectView, picture: StereoViews, resolution: int) -> Trimesh:
        """The chosen object's own mesh, posed."""
        return self.nearest(view.shard).mesh.apply_transform(view.pose.rig_from_object)


def grid_occupancy(mesh: Trimesh, cells: int) -> NDArray[np.bool_]:
    """Whether a mesh of the object frame contains the centres of the cells of ``[-0.5, 0.5]^3``, ``(cells^3,)``."""
    axis_C = (np.arange(cells) + 0.5) / cells - 0.5
    grid_N3 = np.stack(np.meshgrid(axis_C, axis_C, axis_C, indexing="ij"), axis=-1).reshape(-1, 3)
    return contains(mesh, grid_N3)
