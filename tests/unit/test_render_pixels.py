"""Samples become pixels by known arithmetic."""

import numpy as np
import pytest

from stereo_occ.render.pixels import DEPTH_STEP, center_depth, mean_color, over


def test_mean_is_taken_over_the_squares_of_samples():
    samples = np.arange(16, dtype=np.uint8).reshape(1, 4, 4, 1)
    assert mean_color(samples, 2)[0, ..., 0].tolist() == [[3, 5], [11, 13]]  # 2.5, 4.5, 10.5, 12.5 rounded up


@pytest.mark.parametrize("factor", [1, 2, 3, 16])
def test_mean_of_white_is_white(factor):
    assert (mean_color(np.full((2, 32 * factor, 32 * factor, 4), 255, np.uint8), factor) == 255).all()


def test_depth_of_a_plane_is_exact_at_pixel_centres():
    """n . x = d over the rays (u, v, 1) of a pixel grid: 1 / z is linear in u and v."""
    normal, distance, factor, side = np.array([0.3, -0.2, 1.0]), 0.9, 2, 8

    def plane_depth(count):
        steps = ((np.arange(count) + 0.5) / count - 0.5) * 0.4
        v, u = np.meshgrid(steps, steps, indexing="ij")
        return (distance / (normal[0] * u + normal[1] * v + normal[2])).astype(np.float32)

    found = center_depth(plane_depth(side * factor)[None], factor)[0]
    np.testing.assert_allclose(found, plane_depth(side), rtol=1e-6)


def test_depth_is_never_between_two_surfaces():
    near, far = 0.8, 0.8 * (1 + 2 * DEPTH_STEP)
    samples = np.array([[[near, far], [far, far]]], np.float32)
    assert center_depth(samples, 2).item() == np.float32(near)
    samples = np.array([[[0, 0], [0, far]]], np.float32)
    assert center_depth(samples, 2).item() == pytest.approx(far, rel=1e-6)
    assert center_depth(np.zeros((1, 2, 2), np.float32), 2).item() == 0


def test_compositing_adds_background_for_what_is_not_covered():
    premultiplied = np.array([[[[100, 50, 0, 255], [64, 32, 0, 128], [0, 0, 0, 0]]]], np.uint8)
    background = np.array([255, 100, 10], np.uint8)
    expected = [[100, 50, 0], [64 + 127, 32 + 50, 5], [255, 100, 10]]
    assert over(premultiplied, background)[0, 0].tolist() == expected


def test_white_over_white_stays_white_at_every_coverage():
    coverage = np.arange(256, dtype=np.uint8)
    premultiplied = np.repeat(coverage[:, None], 4, axis=1)[None, None]
    assert (over(premultiplied, np.full(3, 255, np.uint8)) == 255).all()
