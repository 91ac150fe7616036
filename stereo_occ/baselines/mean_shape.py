"""The rotation-blind mean shape: the share of all training poses in which a point of the working cube is occupied.

It ignores the pictures. What a network scores beyond it, it has seen.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from stereo_occ.baselines.base import Baseline, Field
from stereo_occ.decision import Decision
from stereo_occ.predictors import ObjectView


class MeanShape(Baseline):
    """One field of probabilities for every view.

    Args:
        occupancy_CCC: mean occupancy of the cells of the working cube, x, y, z.
        decision: chosen on validation objects.
    """

    def __init__(self, occupancy_CCC: NDArray[np.float64], decision: Decision = Baseline.decision) -> None:
        self.occupancy_CCC = occupancy_CCC.clip(0, 1)
        self.decision = decision

    def look(self, view: ObjectView) -> Field:
        """The mean shape, whatever the view."""
        return self.field

    def field(self, points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolated between the centres of cells, 0 outside the cube."""
        cells_N3 = (points_N3 + 0.5) * len(self.occupancy_CCC) - 0.5
        values_N = map_coordinates(self.occupancy_CCC, cells_N3.T, order=1, mode="nearest")
        return np.where((np.abs(points_N3) <= 0.5).all(axis=1), values_N, 0.0)


def mean_occupancy(views: Iterable[ObjectView], cells: int) -> NDArray[np.float64]:
    """Mean occupancy of each cell of the working cube over views, from the occupied points of their box pools.

    A pool's points are uniform in the object's box, so each stands for the same volume. Of few points, what should be 1
    may come out a little above it.

    Raises:
        ValueError: there are no views.
    """
    volume_C = np.zeros(cells**3)
    count = 0
    for view in views:
        pool, pose = view.shard.pool("box"), view.pose
        cells_N3 = np.floor((pose.to_rig(pool.points_N3[pool.occupied_N]) + 0.5) * cells).astype(np.intp)
        within_N3 = cells_N3[((cells_N3 >= 0) & (cells_N3 < cells)).all(axis=1)]
        index_N = np.ravel_multi_index(tuple(within_N3.T), (cells,) * 3)
        point_volume = pose.scale**3 * float(np.prod(pool.extent_3)) / len(pool)
        volume_C += np.bincount(index_N, minlength=cells**3) * point_volume
        count += 1
    if not count:
        raise ValueError("the mean shape of no views")
    return (volume_C * cells**3 / count).reshape((cells,) * 3)
