"""Heights and widths of boxes in any pose."""

import numpy as np
import pytest
import trimesh

from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.metrics.size import size_errors

POSES = [
    Pose(rotation, 0.5, np.array([0.1, 0, 0.2])).rig_from_object
    for rotation in random_rotations(4, np.random.default_rng(0))
]


def box(pose, *extents):
    return trimesh.creation.box(extents).apply_transform(pose)


@pytest.mark.parametrize("pose", POSES)
def test_boxes(pose):
    errors = size_errors(box(pose, 0.4, 0.5, 0.3), box(pose, 0.2, 0.8, 0.32), pose, unit=0.2)
    assert errors == pytest.approx({"height_error": 0.2 * 0.5 * 0.3, "width_error": 0.2 * 0.5 * 0.08})


def test_nothing_errs_by_the_whole():
    errors = size_errors(trimesh.Trimesh(), box(POSES[0], 0.4, 0.5, 0.3), POSES[0], unit=2)
    assert errors == pytest.approx({"height_error": 0.5, "width_error": 0.4})
