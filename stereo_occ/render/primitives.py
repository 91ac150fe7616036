"""Unit solids for clutter: positions, normals and faces; each stands on y = 0, 1 high and 1 wide."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

Solid = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]

SECTIONS = 24

UP = np.array([0.0, 1.0, 0.0])


@cache
def box() -> Solid:
    """Half a metre either side of the Y axis."""
    positions: list[NDArray[np.float64]] = []
    normals: list[NDArray[np.float64]] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal_3 = np.roll([sign, 0.0, 0.0], axis)
            across_3, along_3 = np.roll([0, 1.0, 0], axis), np.roll([0, 0, sign], axis)
            corners = [(a * across_3 + b * along_3 + normal_3) / 2 for a, b in CORNERS]
            faces += [[len(positions) + k for k in triangle] for triangle in ((0, 1, 2), (0, 2, 3))]
            positions += [corner + UP / 2 for corner in corners]
            normals += [normal_3] * 4
    return np.array(positions), np.array(normals), np.array(faces)


CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


@cache
def cylinder() -> Solid:
    """About the Y axis, closed at both ends."""
    rim = [(0.5, 0.0), (0.5, 1.0)]
    side = _turned(rim, [(1.0, 0.0)] * 2)
    return _joined(
        side,
        _turned([(0.5, 1.0), (0.0, 1.0)], [(0.0, 1.0)] * 2),
        _turned([(0.0, 0.0), (0.5, 0.0)], [(0.0, -1.0)] * 2),
    )


@cache
def ball() -> Solid:
    """Resting on its lowest point."""
    angle_R = np.linspace(-np.pi / 2, np.pi / 2, SECTIONS // 2 + 1)
    profile = np.stack([np.cos(angle_R), np.sin(angle_R)], axis=1)
    return _turned(list(map(tuple, profile / 2 + [0, 0.5])), list(map(tuple, profile)))


@cache
def plane() -> Solid:
    """A square at y = 0 that faces +Y."""
    positions = np.array([[a / 2, 0, -b / 2] for a, b in CORNERS])
    return positions, np.tile([0.0, 1.0, 0.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])


def grid(lines_N: NDArray[np.float64]) -> Solid:
    """A square at y = 0 that faces +Y, cut along the same ascending lines ``(N,)`` in x and in z; row by row."""
    z_V, x_V = (lines.ravel() for lines in np.meshgrid(lines_N, lines_N, indexing="ij"))
    positions = np.stack([x_V, np.zeros_like(x_V), z_V], axis=1)
    count = len(lines_N)
    first = (np.arange(count - 1) + count * np.arange(count - 1)[:, None]).ravel()
    a, b, c, d = first, first + count, first + count + 1, first + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return positions, np.tile(UP, (len(positions), 1)), faces


def _turned(profile: list[tuple[float, float]], normals: list[tuple[float, float]]) -> Solid:
    """A profile (radius, height), bottom up, turned about +Y; its normals point away from the solid."""
    turn_S = np.linspace(0, 2 * np.pi, SECTIONS + 1)
    around_S2 = np.stack([np.sin(turn_S), np.cos(turn_S)], axis=1)

    def ring(radius: float, height: float) -> NDArray[np.float64]:
        return np.insert(radius * around_S2, 1, height, axis=1)

    rows = SECTIONS + 1
    first = np.arange(SECTIONS) + rows * np.arange(len(profile) - 1)[:, None]
    a, b, c, d = (corner.ravel() for corner in (first, first + 1, first + rows + 1, first + rows))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return (
        np.concatenate([ring(*point) for point in profile]),
        np.concatenate([ring(*normal) for normal in normals]),
        faces,
    )


def _joined(*solids: Solid) -> Solid:
    offsets = np.cumsum([0, *(len(positions) for positions, _, _ in solids)])
    return (
        np.concatenate([positions for positions, _, _ in solids]),
        np.concatenate([normals for _, normals, _ in solids]),
        np.concatenate([faces + offset for (_, _, faces), offset in zip(solids, offsets[:-1], strict=True)]),
    )
