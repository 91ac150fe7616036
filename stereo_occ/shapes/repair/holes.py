"""Open pieces of a mesh: which borders may be closed, and which pieces may go."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from trimesh import Trimesh

from stereo_occ.occupancy.contains import contains
from stereo_occ.shapes.distance import spread
from stereo_occ.shapes.repair.topology import Faces, borders

#: A hole of at most this area (2 % of the diagonal across) is a pin-hole.
PIN_HOLE = 3e-4
#: Of a scan, the base that it stood on, and the bottom inside that no camera saw.
MOST_OPENINGS = 2
#: An opening is flat if no point of its border is farther from a plane.
FLAT = 0.02
#: A border or piece this near to a body lies on it.
ON_BODY = 0.008


class Bodies:
    """Closed meshes, to tell what lies in or on them."""

    def __init__(self, meshes: list[Trimesh]) -> None:
        self._meshes = meshes
        self._trees = [cKDTree(spread(mesh.triangles, ON_BODY / 4)[0]) for mesh in meshes]

    def hold(self, points_N3: NDArray[np.floating]) -> bool:
        """Whether all but one in fifty of the points lie in one of the bodies, or on it."""
        held_N = np.zeros(len(points_N3), bool)
        for mesh, tree in zip(self._meshes, self._trees, strict=True):
            held_N |= contains(mesh, points_N3) | (
                tree.query(points_N3, distance_upper_bound=ON_BODY)[0] < ON_BODY
            )
        return bool(held_N.mean() >= 0.98)


def close_pin_holes(
    vertices_V3: NDArray[np.float64], faces_F3: Faces, bodies: Bodies
) -> tuple[NDArray[np.float64], Faces, int, int] | None:
    """A piece with its borders closed by fans, and how many were pin-holes and how many ends held by bodies.

    None if some border is neither: closing the rim of a cup would fill it.
    """
    loops = borders(faces_F3)
    if loops is None:
        return None
    pin_holes = ends = 0
    for loop in loops:
        points_L3 = vertices_V3[loop]
        if _area(points_L3) <= PIN_HOLE:
            pin_holes += 1
        elif bodies.hold(points_L3):
            ends += 1
        else:
            return None
    return *_with_fans(vertices_V3, faces_F3, loops), pin_holes, ends


def close_openings(
    vertices_V3: NDArray[np.float64], faces_F3: Faces
) -> tuple[NDArray[np.float64], Faces, int] | None:
    """A piece with all its borders closed by fans, and how many were no pin-holes.

    None if these are more than :data:`MOST_OPENINGS`, or one is not flat.
    """
    loops = borders(faces_F3)
    if not loops:
        return None
    wide = [points_L3 for points_L3 in (vertices_V3[loop] for loop in loops) if _area(points_L3) > PIN_HOLE]
    if len(wide) > MOST_OPENINGS or not all(_is_flat(points_L3) for points_L3 in wide):
        return None
    return *_with_fans(vertices_V3, faces_F3, loops), len(wide)


def _area(loop_L3: NDArray[np.float64]) -> float:
    spokes_L3 = loop_L3 - loop_L3.mean(axis=0)
    return float(np.linalg.norm(np.cross(spokes_L3, np.roll(spokes_L3, -1, axis=0)), axis=1).sum() / 2)


def _is_flat(loop_L3: NDArray[np.float64]) -> bool:
    spokes_L3 = loop_L3 - loop_L3.mean(axis=0)
    normal_3 = np.linalg.svd(spokes_L3, full_matrices=False)[2][2]
    return bool(np.abs(spokes_L3 @ normal_3).max() <= FLAT)


def _with_fans(
    vertices_V3: NDArray[np.float64], faces_F3: Faces, loops: list[NDArray[np.int64]]
) -> tuple[NDArray[np.float64], Faces]:
    """Loops closed by triangles about their middles."""
    for loop in loops:
        if len(loop) > 3:
            fan_L3 = np.stack([loop, np.roll(loop, -1), np.full(len(loop), len(vertices_V3))], axis=1)
            vertices_V3 = np.concatenate([vertices_V3, vertices_V3[loop].mean(axis=0)[None]])
        else:
            fan_L3 = loop[None]
        faces_F3 = np.concatenate([faces_F3, fan_L3])
    return vertices_V3, faces_F3
