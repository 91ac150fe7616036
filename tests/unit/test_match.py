"""A part of a picture found in a row of another."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d, shift

from stereo_occ.photographs.match import Shift, _edges, best_shift


def texture(width):
    noise_HWC = np.random.default_rng(0).random((20, width, 3))
    return gaussian_filter1d(noise_HWC, 2, axis=1)


@pytest.mark.parametrize("columns", [0, 17, 33.5, 60])
def test_a_shift_is_found_to_a_fraction_of_a_column(columns):
    row_HXC = texture(100)
    part_HWC = shift(row_HXC, (0, -columns, 0), order=3)[:, :40]
    found = best_shift(part_HWC, row_HXC, np.ones((20, 40)))
    assert found.columns == pytest.approx(columns, abs=0.1)
    assert found.correlation == pytest.approx(1, abs=0.02)


def test_exposure_does_not_matter_and_weights_do():
    row_HXC = texture(100)
    part_HWC = row_HXC[:, 30:70].copy()
    part_HWC[:, :20] = texture(300)[:, 250:270]  # another thing in its left half
    right_HW = np.repeat(np.arange(40) >= 20, 20).reshape(40, 20).T.astype(float)
    found = best_shift(0.5 * part_HWC + [0.1, 0.2, 0.3], row_HXC, right_HW)
    assert found.columns == pytest.approx(30, abs=0.01)
    assert found.correlation == pytest.approx(1)
    assert best_shift(part_HWC, row_HXC, np.ones((20, 40))).correlation < 0.9


def test_a_part_without_any_structure_is_found_nowhere():
    assert best_shift(np.ones((20, 40, 3)), texture(100), np.ones((20, 40))).correlation < 1e-6


def nearer_in_the_middle():
    """A part whose middle is 40 columns on in the row, and its edges 37."""
    part_HWC = texture(60)
    row_HXC = texture(300)[:, 100:260].copy()
    row_HXC[:, 37:97] = part_HWC
    row_HXC[:, 55:85] = part_HWC[:, 15:45]
    return part_HWC, row_HXC


def test_edges_farther_back_than_the_middle_have_a_shift_of_their_own():
    part_HWC, row_HXC = nearer_in_the_middle()
    assert _edges(part_HWC, row_HXC, Shift(40, 0.9)) == pytest.approx((37, 37), abs=0.3)


def test_an_edge_that_is_not_seen_stays_with_the_whole():
    part_HWC, row_HXC = nearer_in_the_middle()
    row_HXC[:, 30:50] = 0.5
    left, right = _edges(part_HWC, row_HXC, Shift(40, 0.9))
    assert left == 40
    assert right == pytest.approx(37, abs=0.3)
