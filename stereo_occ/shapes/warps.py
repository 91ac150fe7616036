"""Smooth deformations of lathed solids around +Z: sections that are not round, waves, leans."""

from collections.abc import Callable

import numpy as np
from manifold3d import Manifold

from stereo_occ.shapes import curves
from stereo_occ.shapes.curves import Points


def with_section(
    solid: Manifold, exponent: float, aspect: float, weight: Callable[[Points], Points] | None = None
) -> Manifold:
    """A lathed solid whose round section becomes a superellipse, with the same width along X.

    Args:
        solid: around +Z.
        exponent: 2 is an ellipse; 4 and more a rounded rectangle.
        aspect: depth along Y over width along X.
        weight: from heights to how far the section is changed there, 0 (round) to 1; everywhere 1 by default.
    """

    def warp(points_N3: Points) -> Points:
        x, y, z = points_N3.T
        radius = np.hypot(x, y)
        on_axis = radius < 1e-12
        cos, sin = np.where(on_axis, 1, x) / np.where(on_axis, 1, radius), y / np.where(on_axis, 1, radius)
        new_cos, new_sin = curves.superellipse(cos, sin, exponent)
        share = np.ones_like(z) if weight is None else weight(z)
        new_x = x + share * (new_cos * radius - x)
        new_y = y + share * (aspect * new_sin * radius - y)
        return np.stack([new_x, new_y, z], axis=1)

    return solid.warp_batch(warp)


def leaning(solid: Manifold, start: float, slope: float) -> Manifold:
    """The solid sheared towards +X above a height, smoothly up to a slope at its top."""
    top = solid.bounding_box()[5]

    def warp(points_N3: Points) -> Points:
        x, y, z = points_N3.T
        return np.stack([x + slope * np.maximum(z - start, 0) ** 2 / (2 * (top - start)), y, z], axis=1)

    return solid.warp_batch(warp)


def scalloped(solid: Manifold, lobes: int, depth: float) -> Manifold:
    """A lathed solid whose radius waves around the axis, by nothing at its base and ``depth`` at its top."""
    base, top = solid.bounding_box()[2], solid.bounding_box()[5]

    def warp(points_N3: Points) -> Points:
        x, y, z = points_N3.T
        wave = 1 + depth * np.cos(lobes * np.arctan2(y, x)) * (z - base) / (top - base)
        return np.stack([x * wave, y * wave, z], axis=1)

    return solid.warp_batch(warp)


def peaked(solid: Manifold, rise: float) -> Manifold:
    """A lathed solid stretched upwards in its four diagonal directions, by ``rise`` times the height."""
    base = solid.bounding_box()[2]

    def warp(points_N3: Points) -> Points:
        x, y, z = points_N3.T
        diagonal = np.sin(2 * np.arctan2(y, x)) ** 2
        return np.stack([x, y, z + rise * diagonal * np.maximum(z - base, 0) ** 2], axis=1)

    return solid.warp_batch(warp)
