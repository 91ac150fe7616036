"""The iso-surface of an occupancy function as a closed mesh.

Grids here have ``C`` cells per axis and ``C + 1`` samples, at the cells' corners. A cell is *mixed*
if some of its corners are inside and some outside: the surface passes through these cells only.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skimage.measure import marching_cubes
from trimesh import Trimesh

from stereo_occ.errors import UserError

_COARSEST = 32  # cells per axis: on coarser grids yet, whole parts of an object may fall between the samples


@dataclass(frozen=True, eq=False)
class SampledField:
    """Occupancy logits on a grid: evaluated around the surface, interpolated on the right side elsewhere.

    Attributes:
        values_CCC: at the cells' corners, x outermost.
        level: logit of the decision threshold.
        low, high: corners ``(3,)`` of the box.
        evaluate: logits ``(N,)`` at grid coordinates ``(N, 3)``, those of the grid's last corner being its cells.
        evaluations: points asked for the values.
    """

    values_CCC: NDArray[np.float32]
    level: float
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    evaluate: Callable[[NDArray[np.float64]], NDArray[np.float32]]
    evaluations: int

    @property
    def cells(self) -> int:
        """Per axis."""
        return len(self.values_CCC) - 1

    def surface(self, steps: int = 0) -> Trimesh:
        """The closed mesh where the level is crossed: marching cubes (Lewiner et al., 2003), faces outward.

        Args:
            steps: of the search for each vertex's true place on its edge of the grid, where marching cubes
                interpolates linearly; each asks one point per vertex.

        Returns:
            In the frame of the box; empty if nothing is inside.
        """
        if not (self.values_CCC > self.level).any():
            return Trimesh()
        # One layer far below the level closes the surface, within 1e-4 of a cell of the box.
        padded = np.pad(self.values_CCC, 1, constant_values=self.level - 1e8)
        vertices_V3, faces_F3, _, _ = marching_cubes(padded, self.level, gradient_direction="ascent")
        vertices_V3 = vertices_V3.astype(np.float64) - 1
        if steps:
            vertices_V3 = self._sharpened(vertices_V3, steps)
        place_V3 = self.low + vertices_V3 / self.cells * (self.high - self.low)
        return Trimesh(place_V3, faces_F3, process=False)

    def _sharpened(self, vertices_V3: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
        """Vertices moved along their edges of the grid to where the level is crossed: the Illinois method.

        The bracket is the edge, so a vertex never leaves it and faces keep their order. Vertices in the middle of
        cells, which marching cubes adds in ambiguous cases, and those of the closing layer stay.
        """
        lower_V3, upper_V3 = np.floor(vertices_V3).astype(np.intp), np.ceil(vertices_V3).astype(np.intp)
        on_edge_V = ((upper_V3 - lower_V3).sum(axis=1) == 1) & (lower_V3 >= 0).all(axis=1)
        on_edge_V &= (upper_V3 <= self.cells).all(axis=1)
        if not on_edge_V.any():
            return vertices_V3
        a_N3, b_N3 = lower_V3[on_edge_V].astype(np.float64), upper_V3[on_edge_V].astype(np.float64)
        f_a_N, f_b_N = (
            self.values_CCC[tuple(ends_V3[on_edge_V].T)].astype(np.float64) - self.level
            for ends_V3 in (lower_V3, upper_V3)
        )
        kept_N = np.zeros(len(a_N3), dtype=np.int8)  # 1: end a stayed in the last step, -1: end b did
        for _ in range(steps):
            middle_N3 = a_N3 + _crossing(f_a_N, f_b_N)[:, None] * (b_N3 - a_N3)
            f_N = self.evaluate(middle_N3).astype(np.float64) - self.level
            keep_b_N = (f_N > 0) == (f_a_N > 0)
            # The end that stays for a second time counts half, or the secants would never come near to it.
            half_a_N, half_b_N = (np.where(kept_N == end, 0.5, 1.0) for end in (1, -1))
            a_N3, f_a_N = (
                np.where(keep_b_N[:, None], middle_N3, a_N3),
                np.where(keep_b_N, f_N, half_a_N * f_a_N),
            )
            b_N3, f_b_N = (
                np.where(keep_b_N[:, None], b_N3, middle_N3),
                np.where(keep_b_N, half_b_N * f_b_N, f_N),
            )
            kept_N = np.where(keep_b_N, -1, 1).astype(np.int8)
        moved_V3 = vertices_V3.copy()
        moved_V3[on_edge_V] = a_N3 + _crossing(f_a_N, f_b_N)[:, None] * (b_N3 - a_N3)
        return moved_V3


def sample_field(
    occupancy: Callable[[NDArray[np.float32]], NDArray[np.floating]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    resolution: int = 128,
    level: float = 0.0,
    batch: int = 65536,
) -> SampledField:
    """Occupancy logits around the surface where they cross ``level``, in the frame and the units of the points asked.

    Multi-resolution iso-surface extraction (Mescheder et al., Occupancy Networks, 2019): ``resolution``
    is halved while it is above 32 and even, and that grid is evaluated in full. On each grid of half
    the spacing only the corners of mixed cells are evaluated, then those of the cells found to be mixed
    in turn, until there are none. So the surface is followed wherever it leads, and the mesh is the one
    of the full grid, except for loose pieces that fall between the samples of the coarser ones.

    Args:
        occupancy: logits ``(N,)`` of points ``(N, 3)``; NaN counts as outside.
        low, high: corners ``(3,)`` of the box to search. The surface is closed where the object leaves it.
        resolution: cells per axis.
        level: logit of the decision threshold.
        batch: points asked at once.

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
    asked = []

    def evaluate(corner_N3: NDArray[np.floating] | NDArray[np.intp], cells: int) -> NDArray[np.float32]:
        points_N3 = (low + corner_N3 / cells * (high - low)).astype(np.float32)
        parts = [occupancy(points_N3[start : start + batch]) for start in range(0, len(points_N3), batch)]
        logits_N = np.concatenate(parts).astype(np.float32)
        asked.append(len(points_N3))
        return np.nan_to_num(logits_N, nan=-np.inf).clip(level - 1e4, level + 1e4)

    values = _refine(evaluate, resolution, level)
    return SampledField(
        values, level, low, high, lambda corner_N3: evaluate(corner_N3, resolution), sum(asked)
    )


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


def _crossing(f_a_N: NDArray[np.float64], f_b_N: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the line from ``f_a`` to ``f_b`` is 0, as a share of the way."""
    return np.divide(f_a_N, f_a_N - f_b_N, out=np.full_like(f_a_N, 0.5), where=f_a_N != f_b_N)


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
