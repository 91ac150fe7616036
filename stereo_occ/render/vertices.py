"""What the two-pass drawing of :mod:`stereo_occ.render.surfaces` takes; needs no OpenGL."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_occ.render.clutter import Clutter
from stereo_occ.render.finish import root_of_linear

#: Components of position, normal, colour (w: inside), place in the texture (w: number of the thing) and openness.
ATTRIBUTES = (3, 3, 4, 4, 1)


@dataclass(frozen=True, eq=False)
class SceneLight:
    """Directional lights, as in :class:`~stereo_occ.render.appearance.Appearance`, the way up and shadows' edges."""

    from_L3: NDArray[np.float64]
    color_L3: NDArray[np.float64]
    ambient: float
    up_3: NDArray[np.float64]
    shadow: float | None


def object_vertices(
    positions_V3: NDArray[np.float64],
    normals_V3: NDArray[np.float64],
    colors_V3: NDArray[np.uint8] | None,
    open_V: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Vertices ``(V, 15)`` of an object that stands on its -Y, with or without colours of its own (sRGB).

    Args:
        open_V: share of the light from all around that reaches them.
    """
    count = len(positions_V3)
    own_V3 = np.zeros((count, 3)) if colors_V3 is None else root_of_linear(colors_V3)
    foot_M3 = positions_V3[
        positions_V3[:, 1] < positions_V3[:, 1].min() + 0.05
    ]  # a handle does not reach down
    axis_3 = (foot_M3.min(axis=0) + foot_M3.max(axis=0)) / 2
    outwards_V = ((positions_V3 - axis_3) * normals_V3)[:, [0, 2]].sum(axis=1)
    inside_V1 = (outwards_V < -0.02)[:, None]
    parts = [positions_V3, normals_V3, own_V3, inside_V1, positions_V3, np.zeros((count, 1)), open_V[:, None]]
    return np.concatenate(parts, axis=1).astype(np.float32)


def surroundings(clutter: Clutter | None) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Vertices and faces of what is around the object."""
    if clutter is None:
        return np.zeros((0, sum(ATTRIBUTES)), np.float32), np.zeros((0, 3), np.int64)
    return clutter.vertices_V15, clutter.faces_F3
