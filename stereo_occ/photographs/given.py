"""What the user gives of a pair: two images, and where the object is in them."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from stereo_occ.calibration import RealPair
from stereo_occ.errors import UserError
from stereo_occ.photographs.locate import Found, in_box, in_mask, on_plain_background
from stereo_occ.photographs.match import SIDES, matched
from stereo_occ.photographs.photo import Photo, developed, open_image, read_mask, whiter

Pair = tuple[Any, Any]
ImageFile = str | Path | Image.Image | NDArray[np.uint8]


def photos_of(left: ImageFile, right: ImageFile) -> tuple[Photo, Photo]:
    """A pair of photographs, each a file, Pillow's image, or RGB ``(H, W, 3)``.

    Raises:
        UserError: one is none of these, or cannot be read.
    """
    photos = developed([_image(image, name) for image, name in zip((left, right), SIDES, strict=True)])
    return photos[0], photos[1]


def _image(image: ImageFile, name: str) -> Image.Image:
    if isinstance(image, Image.Image):
        return image
    if isinstance(image, str | Path):
        return open_image(Path(image), name)
    if not isinstance(image, np.ndarray):
        raise UserError(f"{name}: must be a file or RGB (H, W, 3), got {type(image).__name__}")
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise UserError(f"{name}: an array must be (H, W, 3) of uint8, got {image.shape} of {image.dtype}")
    return Image.fromarray(image)


def both(parts: Pair, name: str) -> Pair:
    """What is given of the left and of the right image.

    Raises:
        UserError: it is not of two images.
    """
    if isinstance(parts, tuple | list) and len(parts) == len(SIDES):
        return parts[0], parts[1]
    raise UserError(f"{name}: must be (left, right), None for what is not known, got {type(parts).__name__}")


def locate_pair(
    pair: RealPair,
    photos: tuple[Photo, Photo],
    boxes: Pair,
    masks: Pair,
    find: str | None,
    required: bool,
) -> tuple[Found, Found] | None:
    """Where the object is in both images, or None where that is neither given nor ``required``.

    What is given for one image alone is looked for in the other, if it is ``required``.

    Args:
        pair: fitted to the photographs.
        find: what to detect in the left image where no box and no mask says where it is: mug, bowl or bottle.

    Raises:
        UserError: it is given wrongly, or not found though it is required.
    """
    in_left, in_right = (_given(*part) for part in zip(photos, boxes, masks, SIDES, strict=True))
    if in_left is not None and in_right is not None:
        return in_left, in_right
    if not required:
        return None
    if in_left is not None:
        return in_left, matched(pair, photos, in_left, 0)
    if in_right is not None:
        return matched(pair, photos, in_right, 1), in_right
    if find is not None:
        from stereo_occ.photographs.detect import detected  # all of torchvision's detectors, for this alone

        in_left = detected(photos[0], find, SIDES[0])
        return in_left, matched(pair, photos, in_left, 0)
    left, right = (
        on_plain_background(photo.rgb_HW3, side) for photo, side in zip(photos, SIDES, strict=True)
    )
    return left, right


def _given(photo: Photo, box: Any, mask: Any, name: str) -> Found | None:
    mask_HW = photo.mask_HW
    if mask is not None:
        if isinstance(mask, np.ndarray):
            if mask.shape != photo.rgb_HW3.shape[:2] or not mask.any():
                raise UserError(f"{name}_mask: must have the image's size and true pixels, got {mask.shape}")
            mask_HW = whiter(mask)
        else:
            mask_HW = read_mask(Path(mask), f"{name}_mask", photo.size)
    if mask_HW is not None and not mask_HW.any():
        raise UserError(f"{name}: the image is transparent everywhere, so no object is seen")
    if box is not None:
        found = in_box(box, photo.size, f"{name}_box")
        return found if mask_HW is None else Found(found.outline_N2, mask_HW, "box and mask")
    return None if mask_HW is None else in_mask(mask_HW)
