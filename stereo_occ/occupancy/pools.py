"""Pools of labelled query points, one object at a time, in the object frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from trimesh.sample import sample_surface

from stereo_occ.errors import UserError
from stereo_occ.occupancy.contains import contains
from stereo_occ.shapes.shape import PARTS, Shape

_LEVELS = 1 << 16  # of a uint16 coordinate


@dataclass(frozen=True, eq=False)
class PointPool:
    """Points with their labels, stored on a 2^16 lattice.

    Points are put on the lattice *before* they are labelled, so a label is exact for the stored point.

    Attributes:
        grid_N3: uint16 lattice cells; a point is the centre of its cell.
        low_3, extent_3: float64, corner and size of the box that the lattice divides, object frame.
        occupied_N: whether the object contains the point.
        part_N: uint8 index into :data:`~stereo_occ.shapes.shape.PARTS`; 0 outside, "wall" for every occupied
            point of an object whose parts are not known.
    """

    grid_N3: NDArray[np.uint16]
    low_3: NDArray[np.float64]
    extent_3: NDArray[np.float64]
    occupied_N: NDArray[np.bool_]
    part_N: NDArray[np.uint8]

    @property
    def points_N3(self) -> NDArray[np.float32]:
        """Points ``(N, 3)``, object frame."""
        return lattice_points(self.grid_N3, self.low_3, self.extent_3)

    def __len__(self) -> int:
        return len(self.grid_N3)


def lattice_points(
    grid_N3: NDArray[np.uint16], low_3: NDArray[np.float64], extent_3: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Centres of the lattice cells, ``(N, 3)`` float32: ``low + (grid + 0.5) / 65536 * extent``."""
    return (low_3 + (grid_N3 + 0.5) / _LEVELS * extent_3).astype(np.float32)


def box_pool(shape: Shape, count: int, rng: np.random.Generator) -> PointPool:
    """``count`` points uniform in the object's bounding box: the query points of the paper."""
    low_3, high_3 = shape.mesh.bounds
    grid_N3 = rng.integers(_LEVELS, size=(count, 3), dtype=np.uint16)
    return _label(shape, grid_N3, low_3, high_3 - low_3)


def surface_pool(
    shape: Shape, count: int, rng: np.random.Generator, sigmas: tuple[float, ...] = (0.01, 0.03)
) -> PointPool:
    """``count`` points near the surface: uniform by area, moved by isotropic normal noise.

    Successive points take the ``sigmas`` (standard deviations in units of the box's diagonal) in turn, so
    each has an equal share of any prefix. Points end at the object's box grown by three times the largest
    sigma; posed, they may leave the working volume a little, which points of :func:`box_pool` never do.

    Raises:
        UserError: if there is no sigma or one is not positive.
    """
    if not sigmas or min(sigmas) <= 0:
        raise UserError(f"sigmas: must be one or more positive lengths, got {sigmas}")
    surface_N3, _ = sample_surface(shape.mesh, count, seed=int(rng.integers(1 << 32)))
    sigma_N1 = np.resize(sigmas, count)[:, None]
    points_N3 = np.asarray(surface_N3) + sigma_N1 * rng.standard_normal((count, 3))
    low_3, high_3 = shape.mesh.bounds + 3 * max(sigmas) * np.array([[-1], [1]])
    cells_N3 = np.floor((points_N3 - low_3) / (high_3 - low_3) * _LEVELS)
    return _label(shape, cells_N3.clip(0, _LEVELS - 1).astype(np.uint16), low_3, high_3 - low_3)


def _label(
    shape: Shape, grid_N3: NDArray[np.uint16], low_3: NDArray[np.float64], extent_3: NDArray[np.float64]
) -> PointPool:
    """The pool of the lattice points, labelled by the object's mesh and parts."""
    points_N3 = lattice_points(grid_N3, low_3, extent_3)
    occupied_N = contains(shape.mesh, points_N3)
    return PointPool(grid_N3, low_3, extent_3, occupied_N, _part_codes(shape, points_N3, occupied_N))


def _part_codes(
    shape: Shape, points_N3: NDArray[np.float32], occupied_N: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """Part codes ``(N,)``: where part solids overlap, handle goes before neck and neck before floor."""
    unknown = sorted(set(shape.parts) - set(PARTS[1:]))
    if unknown:
        raise UserError(
            f"{shape.object_id}: parts must be among {', '.join(PARTS[1:])}, "
            f"got {', '.join(unknown)}; rename them"
        )
    part_N = np.where(occupied_N, PARTS.index("wall"), 0).astype(np.uint8)
    for name in ("floor", "neck", "handle"):
        if name in shape.parts:
            index_M = np.flatnonzero(occupied_N)
            part_N[index_M[contains(shape.parts[name], points_N3[index_M])]] = PARTS.index(name)
    return part_N
