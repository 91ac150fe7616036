"""Ranges ``[low, high]`` of a configuration and the values drawn from them; a fixed value is a range of no width."""

from collections.abc import Sequence

import numpy as np

from stereo_occ.errors import UserError


def bounds(limits: Sequence[float], name: str, least: float = 0, most: float = 1) -> tuple[float, float]:
    """``low, high`` of a range.

    Raises:
        UserError: unless there are two, in order, between ``least`` and ``most``; it names the key.
    """
    if len(limits) != 2 or not least <= limits[0] <= limits[1] <= most:
        raise UserError(
            f"{name}: must be [low, high] with {least:g} <= low <= high <= {most:g}, got {list(limits)}"
        )
    return limits[0], limits[1]


def draw(
    limits: Sequence[float], name: str, rng: np.random.Generator, least: float = 0, most: float = 1
) -> float:
    """A value uniform in a range; see :func:`bounds`."""
    return float(rng.uniform(*bounds(limits, name, least, most)))


def draw_log(
    limits: Sequence[float], name: str, rng: np.random.Generator, least: float = 0, most: float = np.inf
) -> float:
    """A value log-uniform in a range above 0; see :func:`bounds`."""
    return float(np.exp(rng.uniform(*np.log(bounds(limits, name, least, most)))))


def share(value: float, name: str, most: float = 1) -> float:
    """A single number between 0 and ``most``.

    Raises:
        UserError: if it is not.
    """
    if not 0 <= value <= most:
        raise UserError(f"{name}: must lie between 0 and {most:g}, got {value}")
    return value
