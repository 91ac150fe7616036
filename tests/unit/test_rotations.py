import numpy as np
from scipy.stats import kstest

from stereo_occ.geometry.rotations import random_rotations

COUNT = 20_000


def rotations():
    return random_rotations(COUNT, np.random.default_rng(0))


def test_they_are_rotations():
    rotation_N33 = rotations()
    np.testing.assert_allclose(
        rotation_N33 @ rotation_N33.mT, np.broadcast_to(np.eye(3), (COUNT, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotation_N33), 1)


def test_the_angle_has_the_distribution_of_haar_measure():
    """The rotation angle of a uniform rotation has the CDF (theta - sin theta) / pi."""
    cosine_N = (np.trace(rotations(), axis1=1, axis2=2) - 1) / 2
    angle_N = np.arccos(cosine_N.clip(-1, 1))
    assert kstest(angle_N, lambda theta: (theta - np.sin(theta)) / np.pi).pvalue > 0.01


def test_every_object_axis_points_anywhere_with_equal_chance():
    """Archimedes: each coordinate of a uniform direction is uniform in [-1, 1]."""
    for entry_N in rotations().reshape(COUNT, 9).T:
        assert kstest(entry_N, "uniform", args=(-1, 2)).pvalue > 0.001


def test_the_mean_rotation_vanishes():
    """Each entry has variance 1/3."""
    assert np.abs(rotations().mean(axis=0)).max() < 4 / np.sqrt(3 * COUNT)


def test_turning_the_rig_changes_nothing():
    """Haar measure is invariant: R0 R and R R0 are distributed as R."""
    fixed_33, *rest = random_rotations(COUNT, np.random.default_rng(1))
    rotation_N33 = np.array(rest)
    for turned_N33 in (fixed_33 @ rotation_N33, rotation_N33 @ fixed_33):
        cosine_N = (np.trace(turned_N33, axis1=1, axis2=2) - 1) / 2
        angle_N = np.arccos(cosine_N.clip(-1, 1))
        assert kstest(angle_N, lambda theta: (theta - np.sin(theta)) / np.pi).pvalue > 0.01


def test_the_same_seed_gives_the_same_rotations():
    np.testing.assert_array_equal(rotations(), rotations())
    assert not np.array_equal(rotations(), random_rotations(COUNT, np.random.default_rng(1)))
