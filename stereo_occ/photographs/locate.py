"""Where the object is in a photograph."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening, find_objects, label

from stereo_occ.errors import UserError
from stereo_occ.geometry.crop import Box

#: Of the display values 0 to 255, in any channel: what differs more from the background is object.
CONTRAST = 24

#: Share of the image's border that must have the background's colour.
PLAIN = 0.9

#: Least and greatest share of the image that an object may cover.
COVERAGE = (0.0005, 0.8)


@dataclass(frozen=True, eq=False)
class Found:
    """An object in a photograph.

    Attributes:
        outline_N2: pixels whose smallest box is the object's.
        mask_HW: its pixels, where they are known.
        how: in a word.
    """

    outline_N2: NDArray[np.float64]
    mask_HW: NDArray[np.bool_] | None
    how: str

    @property
    def box(self) -> Box:
        """The smallest box around it."""
        return Box.around(self.outline_N2)


def in_box(values: Sequence[float], size: tuple[int, int], name: str) -> Found:
    """As the user says: left, top, right and bottom edge in pixels.

    Raises:
        UserError: these are no box, or one that is not in the image.
    """
    if len(values) != 4:
        raise UserError(f"{name}={list(values)}: must be [left,top,right,bottom] in pixels")
    left, top, right, bottom = map(float, values)
    if not (left < right and top < bottom):
        raise UserError(f"{name}={list(values)}: must have left < right and top < bottom")
    width, height = size
    if min(left, top) < -1 or right > width or bottom > height:
        raise UserError(
            f"{name}={list(values)}: reaches out of the image of {width} x {height} pixels; "
            f"give left, top, right, bottom in its pixels"
        )
    return Found(outline_of(Box(left, top, right, bottom)), None, "box")


def outline_of(box: Box) -> NDArray[np.float64]:
    """Pixels ``(N, 2)`` along the edges of a box: a lens or another camera may bend them."""
    along = np.linspace(0, 1, 9)[:, None]
    corners = np.array(
        [[box.left, box.top], [box.right, box.top], [box.right, box.bottom], [box.left, box.bottom]]
    )
    edges = [a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return np.concatenate(edges)


def in_mask(mask_HW: NDArray[np.bool_], how: str = "mask") -> Found:
    """As a mask with some pixels set says: the outer edges of each row's and column's first and last pixel."""
    points = []
    for turned, mask in ((False, mask_HW), (True, mask_HW.T)):
        lines = np.flatnonzero(mask.any(axis=1))
        first = mask[lines].argmax(axis=1) - 0.5
        last = mask.shape[1] - 0.5 - mask[lines, ::-1].argmax(axis=1)
        for ends in (first, last):
            ends_N2 = np.stack([ends, lines], axis=1)
            points.append(ends_N2[:, ::-1] if turned else ends_N2)
    return Found(np.concatenate(points), mask_HW, how)


def on_plain_background(rgb_HW3: NDArray[np.uint8], name: str) -> Found:
    """The largest thing that differs from the one colour of the image's border.

    Raises:
        UserError: the border has no one colour, or nothing or nearly all of the image differs from it.
    """
    border_N3 = np.concatenate([rgb_HW3[0], rgb_HW3[-1], rgb_HW3[:, 0], rgb_HW3[:, -1]]).astype(np.int16)
    color_3 = np.median(border_N3, axis=0)
    advice = f"give {name}_box=[left,top,right,bottom] or {name}_mask=MASK.png, or find=mug (or bowl, bottle)"
    if (np.abs(border_N3 - color_3).max(axis=1) <= CONTRAST).mean() < PLAIN:
        raise UserError(f"{name}: its background is not plain, so the object cannot be found; {advice}")
    differs_HW = np.abs(rgb_HW3.astype(np.int16) - color_3.astype(np.int16)).max(axis=2) > CONTRAST
    labels_HW, _ = label(binary_opening(differs_HW))
    areas = np.bincount(labels_HW.ravel())[1:]
    share = areas.max(initial=0) / labels_HW.size
    if not COVERAGE[0] <= share <= COVERAGE[1]:
        raise UserError(
            f"{name}: what differs from its background covers {100 * share:.2g} % of it: no object; {advice}"
        )
    # The largest, with what lies within its box: a handle may be apart by a highlight.
    within = find_objects(labels_HW)[int(areas.argmax())]
    mask_HW = np.zeros_like(differs_HW)
    mask_HW[within] = labels_HW[within] > 0
    return in_mask(mask_HW, "plain background")
