"""Photographs: reading any image file, and what another camera at the same place would have taken."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError
from scipy.ndimage import map_coordinates

from stereo_occ.calibration import RealCamera
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera

#: Largest values of the grey levels that cameras deliver in 16 bits.
DEPTHS = tuple(2**bits - 1 for bits in (8, 10, 12, 14, 16))

#: Images of more pixels are not read: they would need gigabytes.
MOST_PIXELS = 150_000_000

#: Transparency above this is object.
OPAQUE = 128

#: Samples per pixel and axis, at most; wider pixels are averaged before.
SAMPLES = 4


@dataclass(frozen=True, eq=False)
class Photo:
    """An image as a camera took it.

    Attributes:
        rgb_HW3: display values.
        mask_HW: where the object is, if the file says so by its transparency.
    """

    rgb_HW3: NDArray[np.uint8]
    mask_HW: NDArray[np.bool_] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width, height in pixels."""
        return self.rgb_HW3.shape[1], self.rgb_HW3.shape[0]


def open_image(path: Path, name: str) -> Image.Image:
    """Any image file that Pillow reads, turned as its EXIF tag says.

    Args:
        name: of the setting that gives the path, for messages.

    Raises:
        UserError: if there is no such file, or it is no image.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the limit is ours
            image = Image.open(path)
        with image:
            if image.width * image.height > MOST_PIXELS:
                raise Image.DecompressionBombError
            image.load()
            return ImageOps.exif_transpose(image)
    except FileNotFoundError as error:
        raise UserError(f"{name}={path}: no such file") from error
    except UnidentifiedImageError as error:
        raise UserError(f"{name}={path}: is no image; give PNG, JPEG, TIFF, BMP, WebP or PGM") from error
    except Image.DecompressionBombError as error:
        raise UserError(
            f"{name}={path}: has more than {MOST_PIXELS / 1e6:.0f} million pixels; scale it down, the calibration is "
            f"scaled with it"
        ) from error
    except (OSError, SyntaxError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{name}={path}: cannot be read ({reason})") from error


def developed(images: Sequence[Image.Image]) -> list[Photo]:
    """Photographs of images of any mode: grey, palette, RGB, RGBA; 8 or 16 bits.

    Grey levels of more than 8 bits are of one depth in all of them, so a pair keeps the brightness that it has.
    """
    grey = [np.asarray(image) for image in images if _has_grey_levels(image)]
    full = _full_scale(grey)
    return [_developed(image, full) for image in images]


def _developed(image: Image.Image, full: float) -> Photo:
    if _has_grey_levels(image):
        levels_HW = np.nan_to_num(np.asarray(image).astype(np.float64), posinf=0, neginf=0)
        bytes_HW = np.rint(255 * levels_HW.clip(0) / full).astype(np.uint8)
        return Photo(np.repeat(bytes_HW[..., None], 3, axis=2))
    if not image.has_transparency_data:
        return Photo(np.asarray(image.convert("RGB")))
    rgba_HW4 = np.asarray(image.convert("RGBA"))
    mask_HW = rgba_HW4[..., 3] >= OPAQUE
    return Photo(rgba_HW4[..., :3], None if mask_HW.all() else mask_HW)


def read_mask(path: Path, name: str, size: tuple[int, int]) -> NDArray[np.bool_]:
    """A mask ``(H, W)`` of a photograph of this width and height: what is white rather than black, or opaque.

    Raises:
        UserError: as :func:`open_image`; if the size differs, or nothing or all of it is object.
    """
    (photo,) = developed([open_image(path, name)])
    mask_HW = whiter(photo.rgb_HW3.max(axis=2)) if photo.mask_HW is None else photo.mask_HW
    if photo.size != size:
        raise UserError(
            f"{name}={path}: has {photo.size[0]} x {photo.size[1]} pixels, its image {size[0]} x {size[1]}"
        )
    if not mask_HW.any() or mask_HW.all():
        what = "is empty" if not mask_HW.any() else "covers the whole image"
        raise UserError(f"{name}={path}: {what}; the object must be white on black")
    return mask_HW


def whiter(levels_HW: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Where a mask is set: above half of its largest level, as soft edges and JPEG's ripples are not."""
    levels = levels_HW.astype(np.float64)
    return np.asarray(levels > levels.max(initial=0) / 2)


def seen_by(
    image_HWC: NDArray[np.uint8], camera: RealCamera, target: Camera, outside: float | None = None
) -> NDArray[np.float32]:
    """What ``target``, at the place of ``camera``, would have taken: ``(H, W, C)`` of 0 to 255, area-averaged.

    Crop, rectification and removal of distortion in one step. A pixel is the mean of samples on a grid in it, each
    interpolated in the image (reduced before, if it is much finer).

    Args:
        image_HWC: taken by ``camera``.
        target: its rig frame is the left camera's.
        outside: value beyond the edges of the image; None: the edge's own.
    """
    reach = pixels_from(target, camera, _corners(target))
    extent = np.ptp(reach, axis=0) / [target.width, target.height]
    scale = float(extent.max())
    factor = max(1, int(scale // SAMPLES))
    per_axis = min(SAMPLES, max(1, ceil(scale / factor)))
    offsets = (np.arange(per_axis) + 0.5) / per_axis - 0.5
    u = (np.arange(target.width)[:, None] + offsets).ravel()
    v = (np.arange(target.height)[:, None] + offsets).ravel()
    grid_N2 = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    source_N2 = pixels_from(target, camera, grid_N2)
    source_N2 = (source_N2 + 0.5) / factor - 0.5
    mode, fill = ("nearest", 0.0) if outside is None else ("grid-constant", outside)
    channels = []
    for channel in np.moveaxis(image_HWC, 2, 0):
        reduced = Image.fromarray(channel).reduce(factor) if factor > 1 else channel
        samples_N = map_coordinates(
            np.asarray(reduced, dtype=np.float32), source_N2.T[::-1], order=1, mode=mode, cval=fill
        )
        samples = samples_N.reshape(target.height, per_axis, target.width, per_axis)
        channels.append(samples.mean(axis=(1, 3)))
    return np.stack(channels, axis=-1)


def pixels_in(target: Camera, camera: RealCamera, pixels_N2: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels ``(N, 2)`` of a photograph in the image of a target at the same place."""
    rays_N3 = camera.rays(pixels_N2) @ _turn(camera, target) @ target.K.T
    return np.asarray(rays_N3[:, :2] / rays_N3[:, 2:])


def pixels_from(target: Camera, camera: RealCamera, pixels_N2: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels ``(N, 2)`` of the target's image in the photograph: the way back from :func:`pixels_in`."""
    return camera.pixels_along(_rays(target, pixels_N2) @ _turn(camera, target).T)


def _turn(camera: RealCamera, target: Camera) -> NDArray[np.float64]:
    """Rotation from the target's axes to the camera's."""
    return np.asarray(camera.rotation_33 @ target.camera_from_rig[:3, :3].T)


def _rays(target: Camera, pixels_N2: NDArray[np.float64]) -> NDArray[np.float64]:
    homogeneous_N3 = np.concatenate([pixels_N2, np.ones_like(pixels_N2[:, :1])], axis=1)
    return np.asarray(homogeneous_N3 @ np.linalg.inv(target.K).T)


def _corners(target: Camera) -> NDArray[np.float64]:
    right, bottom = target.width - 0.5, target.height - 0.5
    return np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])


def _has_grey_levels(image: Image.Image) -> bool:
    """More than 8 bits of one channel."""
    return image.mode.startswith(("I", "F"))


def _full_scale(images: Sequence[NDArray[np.generic]]) -> float:
    """White: of 10, 12, 14 or 16 bits whichever the largest value needs; fractions are of 1."""
    peak = max((float(np.max(image, initial=0, where=np.isfinite(image))) for image in images), default=0.0)
    if peak <= 1 and all(image.dtype.kind == "f" for image in images):
        return 1.0
    return float(next((depth for depth in DEPTHS if peak <= depth), peak))
