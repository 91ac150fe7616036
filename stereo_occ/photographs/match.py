"""The box around an object in one photograph, found from its box in the other.

Both photographs are rectified, so the object lies on the same rows, shifted. First the whole box is compared with all
shifts; that finds the object, but what it matches best is the surface that faces the cameras. The box's edges lie
farther back, at the outline, and so a strip inside of each is compared once more about the first answer.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from stereo_occ.calibration import RealCamera, RealPair
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera
from stereo_occ.geometry.crop import Box
from stereo_occ.photographs.locate import Found, outline_of
from stereo_occ.photographs.photo import Photo, pixels_from, pixels_in, seen_by

#: Nothing is looked for nearer than this, metres.
NEAREST = 0.15

#: Longer side of what is compared, pixels.
COMPARED = 96

#: Shares of the box's width: the strips at its edges, and how far their shift may be from that of the whole.
STRIP, REACH = 0.15, 0.12

#: Correlations below which there is no such object, or an edge is left where the whole box has it.
LEAST, LEAST_STRIP = 0.5, 0.6

#: Samples of the wanted part of a rectified image, to see what of it the photograph shows.
COLUMNS, ROWS = 513, 9

SIDES = ("left", "right")


class Shift(NamedTuple):
    """Where a part fits best: columns, with a fraction, and its correlation."""

    columns: float
    correlation: float


def matched(pair: RealPair, photos: tuple[Photo, Photo], known: Found, index: int) -> Found:
    """The object in the other photograph.

    Args:
        pair: fitted to the photographs.
        known: the object in photograph ``index``.

    Raises:
        UserError: if nothing there looks like it.
    """
    other = 1 - index
    rig = pair.rectified()
    box = Box.around(pixels_in(rig.cameras[index], pair.cameras[index], known.outline_N2))
    width = box.right - box.left
    scale = min(1.0, COMPARED / max(width, box.bottom - box.top))
    farthest_apart = rig.left.K[0, 0] * pair.baseline / NEAREST
    reach_2 = (0, farthest_apart) if other == 0 else (-farthest_apart, 0)
    seen = _seen_columns(
        rig.cameras[other], pair.cameras[other], box, (box.left + reach_2[0], box.right + reach_2[1])
    )
    if seen is None or seen[1] - seen[0] < (1 - 2 * REACH) * width:
        raise UserError(
            f"{SIDES[other]}: what is in the {SIDES[index]} image there is not in this one; check the box and the "
            f"calibration"
        )
    first, last = seen[0] - REACH * width, seen[1] + REACH * width
    part_HWC, row_HWC = (
        seen_by(photos[i].rgb_HW3, pair.cameras[i], _rows(rig.cameras[i], box, left, right, scale)) / 255
        for i, left, right in ((index, box.left, box.right), (other, first, last))
    )
    whole = best_shift(part_HWC, row_HWC, _middle(*part_HWC.shape[:2]))
    if whole.correlation < LEAST:
        raise UserError(
            f"{SIDES[other]}: nothing in it looks like the object in the {SIDES[index]} image; check both images and "
            f"the calibration, or give {SIDES[other]}_box= too"
        )
    left, right = (first + columns / scale for columns in _edges(part_HWC, row_HWC, whole))
    outline_N2 = outline_of(Box(left, box.top, right + width, box.bottom))
    return Found(
        pixels_from(rig.cameras[other], pair.cameras[other], outline_N2), None, f"like the {SIDES[index]} one"
    )


def best_shift(
    part_HWC: NDArray[np.float64], row_HXC: NDArray[np.float64], weight_HW: NDArray[np.float64]
) -> Shift:
    """Where the part is most like the row, by the weighted normalised cross-correlation; sub-column by a parabola."""
    weight_HW = weight_HW / weight_HW.sum()
    windows_HSCW = np.lib.stride_tricks.sliding_window_view(row_HXC, part_HWC.shape[1], axis=1)
    centred_HWC = part_HWC - np.einsum("hwc,hw->c", part_HWC, weight_HW)
    weighted_HWC = centred_HWC * weight_HW[..., None]
    products_S = np.einsum("hscw,hwc->s", windows_HSCW, weighted_HWC)
    means_SC = np.einsum("hscw,hw->sc", windows_HSCW, weight_HW)
    squares_S = np.einsum("hscw,hscw,hw->s", windows_HSCW, windows_HSCW, weight_HW)
    variance_S = (squares_S - (means_SC**2).sum(axis=1)) * (weighted_HWC * centred_HWC).sum()
    correlation_S = products_S / np.sqrt(np.maximum(variance_S, 1e-12))
    best = int(correlation_S.argmax())
    fraction = 0.0
    if 0 < best < len(correlation_S) - 1:
        before, at, after = correlation_S[best - 1 : best + 2]
        fraction = float((before - after) / 2 / (before - 2 * at + after))
    return Shift(best + fraction, float(correlation_S[best]))


def _edges(part_HWC: NDArray[np.float64], row_HXC: NDArray[np.float64], whole: Shift) -> tuple[float, float]:
    """Shifts of the left and of the right edge."""
    H, W = part_HWC.shape[:2]
    strip, reach = min(W, max(3, round(STRIP * W))), round(REACH * W)
    shifts = []
    for start in (0, W - strip):
        low = max(0, round(whole.columns) + start - reach)
        around_HXC = row_HXC[:, low : low + 2 * reach + strip]
        found = best_shift(part_HWC[:, start : start + strip], around_HXC, np.ones((H, strip)))
        sure = found.correlation >= LEAST_STRIP
        shifts.append(low + found.columns - start if sure else whole.columns)
    return shifts[0], shifts[1]


def _seen_columns(
    rectified: Camera, camera: RealCamera, box: Box, wanted: tuple[float, float]
) -> tuple[float, float] | None:
    """The longest run of the wanted columns of a rectified image that its photograph shows in all rows of the box."""
    u_N, v_M = np.linspace(*wanted, COLUMNS), np.linspace(box.top, box.bottom, ROWS)
    grid_N2 = np.stack(np.meshgrid(u_N, v_M), axis=-1).reshape(-1, 2)
    across_MN = pixels_from(rectified, camera, grid_N2)[:, 0].reshape(ROWS, COLUMNS)
    assert camera.size is not None
    runs_N, count = label(((across_MN >= -0.5) & (across_MN <= camera.size[0] - 0.5)).all(axis=0))
    if not count:
        return None
    shown = u_N[runs_N == 1 + np.bincount(runs_N)[1:].argmax()]
    return float(shown[0]), float(shown[-1])


def _middle(height: int, width: int) -> NDArray[np.float64]:
    """More weight to the middle of a box, where the object is."""
    v_H1, u_1W = (np.linspace(-1, 1, count) for count in (height, width))
    return np.exp(-2 * (u_1W**2 + v_H1[:, None] ** 2))


def _rows(camera: Camera, box: Box, left: float, right: float, scale: float) -> Camera:
    """The box's rows of a rectified camera, from one column to another."""
    to_part = np.array([[scale, 0, -scale * left - 0.5], [0, scale, -scale * box.top - 0.5], [0, 0, 1]])
    size = max(1, round(scale * (right - left))), max(1, round(scale * (box.bottom - box.top)))
    return Camera(to_part @ camera.K, camera.camera_from_rig, *size)
