"""Tables and walls that show a photograph, from those that scikit-image brings along."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from skimage import data

from stereo_occ.ranges import draw_log
from stereo_occ.render.finish import root_of_linear
from stereo_occ.render.primitives import Solid, grid

PHOTOGRAPHS = (
    "astronaut", "brick", "camera", "cat", "coffee", "coins", "grass", "gravel", "page", "rocket", "text",
)  # fmt: skip

#: Side of a photograph on the table or the wall, diagonals of the object, log-uniform.
SIDES = (8.0, 20.0)

#: Vertices along each side of a photograph.
SIDE = 320


def draw_pictured(extent: float, rng: np.random.Generator) -> tuple[Solid, NDArray[np.float64]]:
    """A :func:`pictured_plane` with one of them.

    Args:
        extent: side of the plane, diagonals of the object.
    """
    name = PHOTOGRAPHS[int(rng.integers(len(PHOTOGRAPHS)))]
    return pictured_plane(photograph(name), draw_log(SIDES, "SIDES", rng) / extent)


@cache
def photograph(name: str) -> NDArray[np.uint8]:
    """The middle square of one of them, ``(SIDE, SIDE, 3)``."""
    image = Image.fromarray(getattr(data, name)()).convert("RGB")
    side = min(image.size)
    left, top = (image.width - side) / 2, (image.height - side) / 2
    box = (left, top, left + side, top + side)
    return np.asarray(image.resize((SIDE, SIDE), Image.Resampling.BOX, box))


def pictured_plane(rgb_HW3: NDArray[np.uint8], side: float) -> tuple[Solid, NDArray[np.float64]]:
    """A unit plane whose middle shows a photograph, its top at -Z, and the colours ``(V, 4)`` of its vertices.

    Args:
        rgb_HW3: as many rows as columns.
        side: of the photograph, as a share of the plane's; around it is the photograph's mean colour.
    """
    count = len(rgb_HW3)
    lines_N = np.linspace(-side / 2, side / 2, count)
    margin = side / count
    lines_N = np.concatenate([[-0.5, lines_N[0] - margin], lines_N, [lines_N[-1] + margin, 0.5]])
    framed_HW3 = np.broadcast_to(rgb_HW3.mean(axis=(0, 1)), (count + 4, count + 4, 3)).copy()
    framed_HW3[2:-2, 2:-2] = rgb_HW3
    colors_V3 = root_of_linear(framed_HW3.reshape(-1, 3))
    return grid(lines_N), np.insert(colors_V3, 3, 0, axis=1)
