"""The iso-surface of an occupancy function as a closed mesh.

Grids here have ``C`` cells per axis and ``C + 1`` samples, at the cells' corners. A cell is *mixed*
if some of its corners are inside and some outside: the surface passes through these cells only.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from skimage.measure import marching_cubes
from trimesh import Trimesh

from stereo_occ.errors import UserError

_COARSEST = 32  # cells per axis: on coarser grids yet, whole parts of an object may fall between the samples


def extract_mesh(
    occupancy: Callable[[NDArray[np.float32]], NDArray[np.floating]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    resolution: int = 128,
    level: float = 0.0,
    batch: int = 65536,
) -> Trimesh:
    """The surface where occupancy logits cross ``level``, in the frame and the units of the points asked.

    Multi-resolution iso-surface extraction (Mescheder et al., Occupancy Networks, 2019): ``resolution``
    is halved while it is above 32 and even, and that grid is evaluated in full. On each grid of half
    the spacing only the corners of mixed cells are evaluated, then those of the cells found to be mixed
    in turn, until there are none. So the surface is followed wherever it leads, and the mesh is the one
    of the full grid, except for loose pieces that fall between the samples of the coarser ones. Then
    marching cubes (Lewiner et al., 2003), faces outward.

    Args:
        occupancy: logits ``(N,)`` of points ``(N, 3)``; NaN counts as outside.
        low, high: corners ``(3,)`` of the box to search. The surface is closed where the object leaves it.
        resolution: cells per axis.
        level: logit of the decision threshold.
        batch: points asked at once.

    Returns:
        A closed mesh, or an empty one if nothing is inside.

    Raises:
        UserError: if the resolution or batch is below 1, or the box empty.
    """
    if resolution < 1 or batch < 1:
        raise UserError(f"meshing: resolution and batch must be at least 1, got {resolution} and {batch}")
    if not (high > low).all():
        raise UserError(
            f"meshing: low must be below high along every axis, got {low.tolist()}, {high.tolist()}"
        )

    level = float(np.float32(level))  # marching cubes compares in double, the samples are single

    def evaluate(corner_N3: NDArray[np.intp], cells: int) -> NDArray[np.float32]:
        points_N3 = (low + corner_N3 / cells * (high - low)).astype(np.float32)
        parts = [occupancy(points_N3[start : start + batch]) for start in range(0, len(points_N3), batch)]
        logits_N = np.concatenate(parts).astype(np.float32)
        return np.nan_to_num(logits_N, nan=-np.inf).clip(level - 1e4, level + 1e4)

    values = _refine(evaluate, resolution, level)
    if not (values > level).any():
        return Trimesh()
    # One layer far below the level closes the surface, within 1e-4 of a cell of the box.
    padded = np.pad(values, 1, constant_values=level - 1e8)
    vertices_V3, faces_F3, _, _ = marching_cubes(padded, level, gradient_direction="ascent")
    return Trimesh(low + (vertices_V3 - 1) / resolution * (high - low), faces_F3, process=False)


def _refine(
    evaluate: Callable[[NDArray[np.intp], int], NDArray[np.float32]], resolution: int, level: float
) -> NDArray[np.float32]:
    """Samples on the finest grid: evaluated around the surface, interpolated on the right side elsewhere."""
    cells, halvings = resolution, 0
    while cells > _COARSEST and cells % 2 == 0:
        cells, halvings = cells // 2, halvings + 1
    everywhere = np.ones((cells + 1,) * 3, dtype=bool)
    values = evaluate(np.argwhere(everywhere), cells).reshape(everywhere.shape)
    known = everywhere
    for _ in range(halvings):
        mixed = _mixed(values > level).repeat(2, 0).repeat(2, 1).repeat(2, 2)
        cells, values, known = 2 * cells, _double(values), _double_known(known)
        while (missing := _corners(mixed) & ~known).any():
            values[missing] = evaluate(np.argwhere(missing), cells)
            known |= missing
            mixed = _mixed(values > level)
    return values


def _mixed(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells ``(C, C, C)`` whose corners ``(C + 1, C + 1, C + 1)`` disagree."""
    some, every = inside, inside
    for axis in range(3):
        lower, upper = _ends(axis)
        some, every = some[lower] | some[upper], every[lower] & every[upper]
    return some & ~every


def _corners(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples that are a corner of one of the cells."""
    for axis in range(3):
        lower, upper = _ends(axis)
        padded = np.pad(cells, [(1, 1) if axis == other else (0, 0) for other in range(3)])
        cells = padded[lower] | padded[upper]
    return cells


def _double(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Samples on the grid of half the spacing, by linear interpolation: like between like corners."""
    for axis in range(3):
        lower, upper = _ends(axis)
        doubled = np.repeat(values, 2, axis)[lower]
        odd = tuple(slice(1, None, 2) if axis == other else slice(None) for other in range(3))
        doubled[odd] = (values[lower] + values[upper]) / 2
        values = doubled
    return values


def _double_known(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same samples on the grid of half the spacing; those between them are unknown."""
    doubled = np.zeros([2 * side - 1 for side in known.shape], dtype=bool)
    doubled[::2, ::2, ::2] = known
    return doubled


def _ends(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Indices of all but the last and of all but the first along one of three axes."""
    lower, upper = [slice(None)] * 3, [slice(None)] * 3
    lower[axis], upper[axis] = slice(None, -1), slice(1, None)
    return tuple(lower), tuple(upper)
