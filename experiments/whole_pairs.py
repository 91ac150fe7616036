"""Whole photographs and what ``reconstruct`` makes of them: what the experiments on them share."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.calibration import RealPair
from stereo_occ.geometry.camera import transform_points
from stereo_occ.geometry.crop import Box
from stereo_occ.metrics.size import size_errors
from stereo_occ.metrics.solid import mesh_iou
from stereo_occ.reconstructor import Reconstruction, Reconstructor, SurfaceOptions

#: Of a reconstruction; lengths in metres.
COLUMNS = ("iou", "height_error", "width_error", "center_error")

#: What ``reconstruct`` is told of where the object is.
Told = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Photographs:
    """A pair as a user has it, and what only the renderer knows; lengths in metres, left camera's frame.

    Attributes:
        mesh: of the object, in the object frame.
    """

    rgb_2HW3: NDArray[np.uint8]
    mask_2HW: NDArray[np.bool_]
    pair: RealPair
    left_from_object: NDArray[np.float64]
    mesh: Trimesh

    @property
    def true_mesh(self) -> Trimesh:
        """Left camera's frame, metres."""
        return Trimesh(
            transform_points(self.mesh.vertices, self.left_from_object), self.mesh.faces, process=False
        )

    @property
    def boxes_24(self) -> NDArray[np.float64]:
        """Left, top, right and bottom of the object in each image, pixels."""
        return np.array([list(vars(Box.of_mask(mask_HW)).values()) for mask_HW in self.mask_2HW])


def reconstructed(reconstruct: Reconstructor, photographs: Photographs, told: Told) -> Reconstruction:
    """What is measured: one answer, without that for the mirror image.

    Raises:
        UserError: nothing is found to be occupied, or the object is not found in the other image.
    """
    left, right = photographs.rgb_2HW3
    return reconstruct(
        left, right, photographs.pair, mirror=False, surface=SurfaceOptions(resolution=96), **told
    )


def compared(mesh: Trimesh, photographs: Photographs) -> list[float]:
    """The values of ``COLUMNS`` of a mesh; left camera's frame, metres."""
    pose, true = photographs.left_from_object, photographs.true_mesh
    height, width = size_errors(mesh, true, pose, unit=1.0).values()
    center = float(np.linalg.norm(mesh.bounds.mean(axis=0) - true.bounds.mean(axis=0)))
    return [mesh_iou(mesh, true) or 0.0, height, width, center]
