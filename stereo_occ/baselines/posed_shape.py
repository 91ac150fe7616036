"""Answers that are a known mesh at the true pose."""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.baselines.base import Baseline, Field
from stereo_occ.data.shard import Shard
from stereo_occ.models.base import StereoViews
from stereo_occ.occupancy.contains import contains
from stereo_occ.predictors import ObjectView


class PosedShape(Baseline):
    """Inside or outside of a mesh that is chosen for each object, posed as the object is."""

    @abstractmethod
    def shape(self, shard: Shard) -> Trimesh:
        """The mesh of the object frame that stands for an object."""

    def look(self, view: ObjectView) -> Field:
        mesh, pose = self.shape(view.shard), view.pose

        def field(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
            return contains(mesh, pose.to_object(points_N3)).astype(np.float64)

        return field

    def mesh(self, view: ObjectView, picture: StereoViews, resolution: int) -> Trimesh:
        """The mesh itself, posed, whatever the resolution."""
        return self.shape(view.shard).apply_transform(view.pose.rig_from_object)


class TrueShape(PosedShape):
    """The object itself: the ceiling of every metric, and what each gives to a perfect answer."""

    def shape(self, shard: Shard) -> Trimesh:
        return shard.mesh
