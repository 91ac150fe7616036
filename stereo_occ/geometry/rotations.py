"""Rotations of objects in the rig."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


def random_rotations(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """``count`` rotation matrices ``(count, 3, 3)``, uniform on SO(3) (Haar measure).

    Four independent normal variates, normalised, are a uniform unit quaternion (Shoemake, Graphics Gems III, 1992),
    and the double cover of SO(3) by unit quaternions carries the uniform measure over.
    """
    return np.asarray(Rotation.from_quat(rng.standard_normal((count, 4))).as_matrix())
