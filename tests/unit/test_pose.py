import numpy as np
import pytest

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import transform_points
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations

QUARTER_TURN_ABOUT_Z = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def test_a_quarter_turn_then_scale_then_shift():
    pose = Pose(QUARTER_TURN_ABOUT_Z, 2.0, np.array([0.0, 0, 10]))
    np.testing.assert_allclose(pose.to_rig(np.array([[1.0, 0, 0]])), [[0, 2, 10]])


def test_matrix_and_inverse_agree_with_to_rig():
    rng = np.random.default_rng(0)
    for rotation_33 in random_rotations(10, rng):
        pose = Pose(rotation_33, rng.uniform(0.4, 1), rng.uniform(-0.2, 0.2, 3))
        points_N3 = rng.normal(size=(20, 3))
        rig_N3 = pose.to_rig(points_N3)
        np.testing.assert_allclose(rig_N3, transform_points(points_N3, pose.rig_from_object), atol=1e-12)
        np.testing.assert_allclose(pose.to_object(rig_N3), points_N3, atol=1e-12)


@pytest.mark.parametrize(
    ("rotation", "scale", "center", "complaint"),
    [
        (np.diag([1.0, 1, -1]), 1.0, np.zeros(3), "pose.rotation.*determinant"),
        (2 * np.eye(3), 1.0, np.zeros(3), "pose.rotation"),
        (np.eye(4), 1.0, np.zeros(3), r"pose.rotation.*\(4, 4\)"),
        (np.eye(3), 0.0, np.zeros(3), "pose.scale.*0.0"),
        (np.eye(3), np.nan, np.zeros(3), "pose.scale.*nan"),
        (np.eye(3), 1.0, np.array([0, np.nan, 0]), "pose.center.*nan"),
    ],
)
def test_what_is_no_pose_is_refused(rotation, scale, center, complaint):
    with pytest.raises(UserError, match=complaint):
        Pose(rotation, scale, center)
