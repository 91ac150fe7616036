"""What a model is given of a pair of photographs: cut, straightened, and behind the object what it was trained with."""

import numpy as np
import torch
from numpy.typing import NDArray

from stereo_occ.calibration import RealPair
from stereo_occ.errors import UserError
from stereo_occ.models.base import StereoViews
from stereo_occ.photographs.framing import Framing
from stereo_occ.photographs.locate import Found
from stereo_occ.photographs.photo import Photo, seen_by
from stereo_occ.render.appearance import BackgroundConfig


def views_of(
    pair: RealPair,
    photos: tuple[Photo, Photo],
    found: tuple[Found, Found] | None,
    framing: Framing,
    background: BackgroundConfig,
    checkpoint: str,
) -> StereoViews:
    """A batch of one pair; where both masks are known and the training had such, one colour behind the object.

    Args:
        background: of the training.
        checkpoint: its name, for what is refused.

    Raises:
        UserError: the training had no background, and what is behind the object is not known.
    """
    masks = [None, None] if found is None else [part.mask_HW for part in found]
    unknown = sum(mask_HW is None for mask_HW in masks)
    if unknown and (background.masked == 1 or (unknown == 1 and background.clutter is None)):
        raise UserError(
            f"the checkpoint {checkpoint} was trained on pictures without a background: give left_mask= and "
            f"right_mask=, or images that are transparent around the object"
        )
    cut_out = not unknown and (background.masked or background.clutter is None)
    images_2CHW = []
    for photo, mask_HW, camera, view in zip(photos, masks, pair.cameras, framing.cameras, strict=True):
        rgb_HW3: NDArray[np.floating] = seen_by(photo.rgb_HW3, camera, view) / 255
        if cut_out and mask_HW is not None:
            share_HW1 = seen_by(mask_HW[..., None].astype(np.uint8) * 255, camera, view, outside=0) / 255
            color_3 = (np.array(background.low) + background.high) / 2
            rgb_HW3 = rgb_HW3 * share_HW1 + color_3 * (1 - share_HW1)
        images_2CHW.append(torch.as_tensor(np.asarray(rgb_HW3, dtype=np.float32)).permute(2, 0, 1))
    cameras = framing.rig.cameras
    return StereoViews(
        images_2CHW[0][None],
        images_2CHW[1][None],
        torch.as_tensor(np.stack([camera.K for camera in cameras]), dtype=torch.float32)[None],
        torch.as_tensor(np.stack([c.camera_from_rig for c in cameras]), dtype=torch.float32)[None],
    )
