"""Planar curves of the procedural objects: a profile is (radius, height), a path is (x, height)."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

Points: TypeAlias = NDArray[np.float64]


def bezier(control_K2: ArrayLike, count: int = 24) -> Points:
    """Points of a Bezier curve of any degree (de Casteljau), equally spaced in its parameter, (count, 2)."""
    t_N11 = np.linspace(0, 1, count)[:, None, None]
    points_NK2 = np.broadcast_to(np.asarray(control_K2, np.float64), (count, *np.shape(control_K2)))
    while points_NK2.shape[1] > 1:
        points_NK2 = (1 - t_N11) * points_NK2[:, :-1] + t_N11 * points_NK2[:, 1:]
    return points_NK2[:, 0]


def monotone(heights: Sequence[float], radii: Sequence[float], count: int = 32) -> Points:
    """A smooth profile through the given radii, (count, 2): monotone cubic, so it never overshoots them."""
    y_N = np.linspace(heights[0], heights[-1], count)
    return np.stack([PchipInterpolator(heights, radii)(y_N), y_N], axis=1)


def filleted(corners_K2: ArrayLike, radius: float, per_corner: int = 9) -> Points:
    """The polyline with each inner corner replaced by a curve that starts ``radius`` before it.

    The fillet is cut back to 45 % of the shorter edge at that corner, so neighbouring fillets never meet.
    """
    corners = np.asarray(corners_K2, np.float64)
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        lengths = np.linalg.norm([before - corner, after - corner], axis=1)
        cut = min(radius, 0.45 * lengths.min())
        start = corner + (before - corner) * cut / lengths[0]
        end = corner + (after - corner) * cut / lengths[1]
        pieces.append(
            bezier([start, 0.45 * start + 0.55 * corner, 0.45 * end + 0.55 * corner, end], per_corner)
        )
    return np.concatenate([*pieces, corners[-1:]])


def resampled(points_N2: Points, count: int) -> Points:
    """The polyline at ``count`` points equally spaced along its length, (count, 2)."""
    length_N = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points_N2, axis=0), axis=1))])
    at = np.linspace(0, length_N[-1], count)
    return np.stack([np.interp(at, length_N, points_N2[:, axis]) for axis in range(2)], axis=1)


def smallest_bend(points_N2: Points) -> float:
    """The smallest radius of curvature along a polyline: of the circles through three neighbours."""
    a, b, c = points_N2[:-2], points_N2[1:-1], points_N2[2:]
    ab, bc, ca = b - a, c - b, a - c
    area = np.abs(ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0]) / 2
    sides = np.linalg.norm(ab, axis=1) * np.linalg.norm(bc, axis=1) * np.linalg.norm(ca, axis=1)
    return float((sides / (4 * area + 1e-12)).min())


def superellipse(cos_N: Points, sin_N: Points, exponent: float) -> tuple[Points, Points]:
    """The point of the unit superellipse |x|^n + |y|^n = 1 in each direction given by its cosine and sine."""
    length_N = (np.abs(cos_N) ** exponent + np.abs(sin_N) ** exponent) ** (-1 / exponent)
    return cos_N * length_N, sin_N * length_N
