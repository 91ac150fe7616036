"""From samples to pixels: a pixel is a square of ``factor`` by ``factor`` samples."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Samples of a pixel whose depths differ by more than this share are not of one surface.
DEPTH_STEP = 0.02


def mean_color(samples_NHWC: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """The mean of each pixel's samples, rounded half up; for ``factor`` up to 16."""
    total = _samples_of_pixels(samples_NHWC, factor).sum(axis=0, dtype=np.uint16)
    mean: NDArray[np.uint8] = ((total + factor * factor // 2) // (factor * factor)).astype(np.uint8)
    return mean


def center_depth(samples_NHW: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Depth at the centres of pixels; where the samples are not of one surface, that of the nearest.

    Inverse depth is linear over the image of a plane, so its mean over a pixel is its value at the centre.

    Args:
        samples_NHW: metres along the optical axis, 0 where there is nothing.
    """
    samples = _samples_of_pixels(samples_NHW, factor)
    inverse = np.divide(1, samples, out=np.zeros_like(samples), where=samples > 0)
    nearest = inverse.max(axis=0)
    smooth = inverse.min(axis=0) > (1 - DEPTH_STEP) * nearest
    inverse_at_center = np.where(smooth, inverse.mean(axis=0), nearest)
    depth_NHW: NDArray[np.float32] = np.divide(
        1, inverse_at_center, out=np.zeros_like(nearest), where=nearest > 0
    )
    return depth_NHW


def over(premultiplied_NHW4: NDArray[np.uint8], background_3: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Premultiplied colour with coverage, laid over one colour (Porter and Duff, SIGGRAPH 1984)."""
    uncovered = 255 - premultiplied_NHW4[..., 3:].astype(np.uint16)
    return premultiplied_NHW4[..., :3] + ((uncovered * background_3 + 127) // 255).astype(np.uint8)


def _samples_of_pixels(samples_NHW: NDArray[Any], factor: int) -> NDArray[Any]:
    """``(factor^2, N, H, W, ...)``: first all pixels' first samples, which NumPy reduces several times faster."""
    return np.stack([samples_NHW[:, i::factor, j::factor] for i in range(factor) for j in range(factor)])
