"""Where the object is in each view."""

import numpy as np

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations

ATTEMPTS = 10_000

# A unit diagonal at the fixation point of the paper's rig touches the views' borders, and must not fail by rounding.
ROUNDING = 1e-9  # metres


def draw_pose(kind: str, diagonal: tuple[float, float], rig: StereoRig, rng: np.random.Generator) -> Pose:
    """A pose with uniform rotation, at the fixation point (``paper``) or anywhere that stays visible (``free``).

    Both draw the box diagonal log-uniformly from ``diagonal``; ``free`` draws the centre uniformly over the places
    where the bounding sphere lies inside the cube ``[-0.5, 0.5]^3`` and inside both views.

    Raises:
        UserError: the rig leaves no place for the object.
    """
    rotation = random_rotations(1, rng)[0]
    scale = float(np.exp(rng.uniform(*np.log(diagonal))))
    if kind == "paper":
        return Pose(rotation, scale, np.zeros(3))
    for _ in range(ATTEMPTS):
        center = rng.uniform(-0.5, 0.5, 3) * (1 - scale)
        if all(camera.clearance(center) >= scale / 2 - ROUNDING for camera in rig.cameras):
            return Pose(rotation, scale, center)
    raise UserError(
        f"placement=free: no place for an object of diagonal {scale:.2f} m is inside both views; "
        f"widen rig.fov_deg or lower placement.diagonal"
    )
