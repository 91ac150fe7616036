"""Less of the path tracer's noise where few paths were traced: light is smoothed within a surface, albedo is not."""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

#: How much albedo, normals and relative depth may differ for two pixels to be of one surface.
ALBEDO, NORMAL, DEPTH = 0.08, 0.15, 0.03

REACH = 3  # pixels to each side that are averaged

SPECK = 4.0  # medians; what is brighter is a single path that met a lamp by chance


def cleaned(
    light_HW3: NDArray[np.float32],
    albedo_HW3: NDArray[np.float32],
    normal_HW3: NDArray[np.float32],
    depth_HW: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Linear light whose part that is not albedo is a mean over neighbours of the same surface."""
    albedo_HW3 = albedo_HW3 + np.float32(0.01)
    scaled = (
        albedo_HW3 / ALBEDO,
        normal_HW3 / NORMAL,
        np.log(np.maximum(depth_HW, 1e-3))[..., None] / DEPTH,
    )
    guide_HWC = np.concatenate(scaled, axis=-1, dtype=np.float32)
    shade_HW3 = light_HW3 / albedo_HW3
    shade_HW3 = np.minimum(shade_HW3, SPECK * median_filter(shade_HW3, (5, 5, 1)))
    padding = ((REACH, REACH), (REACH, REACH), (0, 0))
    guides, shades = (np.pad(part, padding, mode="edge") for part in (guide_HWC, shade_HW3))
    total_HW3, weights_HW1 = np.zeros_like(shade_HW3), np.zeros_like(shade_HW3[..., :1])
    height, width = depth_HW.shape
    for row, column in product(range(2 * REACH + 1), repeat=2):
        window = np.s_[row : row + height, column : column + width]
        difference_HW1 = ((guides[window] - guide_HWC) ** 2).sum(axis=-1, keepdims=True)
        weight_HW1 = np.exp(-0.5 * difference_HW1)
        total_HW3 += weight_HW1 * shades[window]
        weights_HW1 += weight_HW1
    return np.asarray(total_HW3 / weights_HW1 * albedo_HW3, np.float32)
