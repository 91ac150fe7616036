"""How far a mesh's height and width are from the object's: what a gripper needs."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

#: Axis of the object frame that points up.
UP = 1


def size_errors(
    predicted: Trimesh, true: Trimesh, rig_from_object: NDArray[np.float64], unit: float
) -> dict[str, float]:
    """``height_error`` and ``width_error``, absolute, metres.

    Height is the extent along the object's upward axis, width the larger of the two others, handle included. An empty
    mesh has neither, so it errs by the whole.

    Args:
        predicted, true: rig frame.
        rig_from_object: 4x4 similarity; its rotation says where up is.
        unit: metres per unit of the rig frame.
    """
    found_2, real_2 = (_height_and_width(mesh, rig_from_object[:3, :3]) for mesh in (predicted, true))
    height, width = unit * np.abs(found_2 - real_2)
    return {"height_error": float(height), "width_error": float(width)}


def _height_and_width(mesh: Trimesh, scaled_rotation_33: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(mesh.faces):
        return np.zeros(2)
    axes_33 = scaled_rotation_33 / np.linalg.norm(scaled_rotation_33, axis=0)
    extents_3 = np.ptp(mesh.vertices @ axes_33, axis=0)
    return np.array([extents_3[UP], np.delete(extents_3, UP).max()])
