"""The nearest training shape at the true pose: what a perfect retrieval and a perfect pose would give.

No floor but a ceiling of recognition: it is told which training object is most like the true one, and where it is.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm
from trimesh import Trimesh

from stereo_occ.baselines.posed_shape import PosedShape
from stereo_occ.data.shard import Shard
from stereo_occ.occupancy.contains import contains


class NearestShape(PosedShape):
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

    def shape(self, shard: Shard) -> Trimesh:
        return self.nearest(shard).mesh


def grid_occupancy(mesh: Trimesh, cells: int) -> NDArray[np.bool_]:
    """Whether a mesh of the object frame contains the centres of the cells of ``[-0.5, 0.5]^3``, ``(cells^3,)``."""
    axis_C = (np.arange(cells) + 0.5) / cells - 0.5
    grid_N3 = np.stack(np.meshgrid(axis_C, axis_C, axis_C, indexing="ij"), axis=-1).reshape(-1, 3)
    return contains(mesh, grid_N3)
