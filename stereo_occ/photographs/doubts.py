"""What speaks against an answer although it could be given: each a line for whoever reads it."""

from collections.abc import Iterator
from math import atan, degrees

import numpy as np

from stereo_occ.calibration import RealPair
from stereo_occ.data.rigs import RectifiedRigConfig
from stereo_occ.geometry.crop import Box
from stereo_occ.photographs.framing import Framing, cube_center
from stereo_occ.photographs.locate import Found
from stereo_occ.photographs.match import SIDES

#: How far beyond the ranges of its training a model is not doubted yet, as a factor.
BEYOND = 1.25

#: Tops and bottoms of an object's boxes may be apart by this share of its height, in rectified images.
ROWS_APART = 0.15

#: An object this near to the edge of its photograph may go on beyond, pixels.
EDGE = 1.0


def doubts(
    pair: RealPair, found: tuple[Found, Found] | None, framing: Framing, config: RectifiedRigConfig
) -> list[str]:
    """Lines about a pair that was framed on its object.

    Args:
        pair: fitted to its images.
        config: of the training.
    """
    lines = [*_unlike_training(pair, framing, config)]
    if found is not None:
        lines += [*_rows_apart(framing.boxes), *_at_an_edge(pair, found)]
    return lines


def _unlike_training(pair: RealPair, framing: Framing, config: RectifiedRigConfig) -> Iterator[str]:
    center_3 = cube_center(framing.cube_from_left)
    middle_3 = (pair.left.center_3 + pair.right.center_3) / 2
    camera = framing.whole.left
    fov_deg = 2 * degrees(atan(camera.width / 2 / camera.K[0, 0]))
    for what, value, trained, unit in (
        ("the cameras are {} apart", pair.baseline, config.baseline, "m"),
        ("the object is {} away", float(np.linalg.norm(center_3 - middle_3)), config.distance, "m"),
        ("the object has a size of {}", framing.unit / float(np.mean(config.fill)), config.diagonal, "m"),
        ("the images are {} wide", fov_deg, config.fov_deg, "degrees"),
    ):
        low, high = trained
        if not low / BEYOND <= value <= high * BEYOND:
            yield (
                f"{what.format(f'{value:.3g} {unit}')}, in the model's training {low:g} to {high:g}: check the "
                f"calibration, its unit and the boxes if that is wrong, and do not trust the answer if it is right"
            )


def _rows_apart(boxes: tuple[Box, Box]) -> Iterator[str]:
    left, right = boxes
    height = (left.bottom - left.top + right.bottom - right.top) / 2
    apart = max(abs(left.top - right.top), abs(left.bottom - right.bottom)) / height
    if apart > ROWS_APART:
        yield (
            f"the object's rows differ by {100 * apart:.0f} % of its height between the rectified images: check that "
            f"the boxes or masks are of the same object, and R and T of the calibration"
        )


def _at_an_edge(pair: RealPair, found: tuple[Found, Found]) -> Iterator[str]:
    for side, camera, part in zip(SIDES, pair.cameras, found, strict=True):
        assert camera.size is not None
        width, height = camera.size
        box = part.box
        room = min(box.left + 0.5, box.top + 0.5, width - 0.5 - box.right, height - 0.5 - box.bottom)
        if room < EDGE:
            yield f"the object reaches the edge of the {side} image: what is beyond is not seen"
