"""What two real cameras make of the light: exposure, blur, noise, compression, each camera in its own way.

Pictures are decoded to linear light, where lenses and photons act, and encoded again at the end.
"""

from dataclasses import dataclass, field, fields
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

from stereo_occ.geometry.camera import StereoRig
from stereo_occ.ranges import bounds
from stereo_occ.render.appearance import GAMMA, Appearance
from stereo_occ.render.stereo import StereoImages


def _none() -> list[float]:
    return [0.0, 0.0]


@dataclass
class SensorConfig:
    """Imperfections of the cameras; a range of zeros is none."""

    exposure: list[float] = field(default_factory=_none)  # of both cameras, stops
    exposure_difference: list[float] = field(default_factory=_none)  # right against left, stops
    white_balance: list[float] = field(default_factory=_none)  # of both: red over blue, stops
    white_balance_difference: list[float] = field(default_factory=_none)  # right against left, stops
    vignetting: list[float] = field(
        default_factory=_none
    )  # 1: light falls off with cos^4 of the angle off the axis
    blur: list[float] = field(default_factory=_none)  # of each camera: Gaussian, standard deviation in pixels
    motion: list[float] = field(default_factory=_none)  # of both: length in pixels, in any direction
    read_noise: list[float] = field(default_factory=_none)  # standard deviation, share of white, linear
    shot_noise: list[float] = field(
        default_factory=_none
    )  # the same at white; grows with the root of the light
    jpeg: list[float] = field(default_factory=_none)  # compression, 0 (none) to 100 (all)

    @property
    def off(self) -> bool:
        """Whether the cameras are ideal."""
        return not any(any(getattr(self, item.name)) for item in fields(self))


LIMITS = {
    "exposure": (-5, 5), "exposure_difference": (-5, 5), "white_balance": (-2, 2),
    "white_balance_difference": (-2, 2), "vignetting": (0, 5), "blur": (0, 20), "motion": (0, 50),
    "read_noise": (0, 0.5), "shot_noise": (0, 0.5), "jpeg": (0, 95),
}  # fmt: skip


def photograph(
    images: StereoImages,
    rig: StereoRig,
    config: SensorConfig,
    appearance: Appearance,
    masked: bool,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """The pictures ``(2, H, W, 3)`` as the cameras take them; coverage and depth stay those of the scene.

    Args:
        rig: the true cameras.
        masked: put the appearance's background afterwards wherever nothing of the object is.

    Raises:
        UserError: for a range out of its limits.
    """
    pictures_2HW3 = images.rgb_2HW3 if config.off else _taken(images.rgb_2HW3, rig, config, rng)
    if masked:
        pictures_2HW3 = np.where(images.mask_2HW[..., None] > 0, pictures_2HW3, appearance.background_3)
    return pictures_2HW3


def _taken(
    rgb_2HW3: NDArray[np.uint8], rig: StereoRig, config: SensorConfig, rng: np.random.Generator
) -> NDArray[np.uint8]:
    drawn = {
        name: rng.uniform(*bounds(getattr(config, name), f"sensor.{name}", *limits), 2)
        for name, limits in LIMITS.items()
    }
    light_2HW3 = DECODED[rgb_2HW3] * _gains(drawn)[:, None, None]
    if drawn["vignetting"][0] > 0:
        light_2HW3 *= np.stack([_falloff(camera.K, *light_2HW3.shape[1:3]) for camera in rig.cameras])[
            ..., None
        ] ** np.float32(drawn["vignetting"][0])
    turn = rng.uniform(0, np.pi)
    for picture_HW3, blur in zip(light_2HW3, drawn["blur"], strict=True):
        _soften(picture_HW3, float(blur))
        _smear(picture_HW3, float(drawn["motion"][0]), turn)
    read, shot = drawn["read_noise"][0], drawn["shot_noise"][0]
    spread_2HW3 = np.sqrt(read**2 + shot**2 * light_2HW3.clip(0), dtype=np.float32)
    light_2HW3 += spread_2HW3 * rng.standard_normal(light_2HW3.shape, np.float32)
    steps_2HW3 = (light_2HW3.clip(0, 1) * (len(ENCODED) - 1) + 0.5).astype(np.uint16)
    taken_2HW3 = ENCODED[steps_2HW3]
    if drawn["jpeg"][0] > 0:
        taken_2HW3 = np.stack([_compressed(picture, int(100 - drawn["jpeg"][0])) for picture in taken_2HW3])
    return taken_2HW3


#: Linear light of display values, and display values of linear light in 65536 steps.
DECODED = ((np.arange(256) / 255) ** GAMMA).astype(np.float32)
ENCODED = np.rint(255 * (np.arange(65536) / 65535) ** (1 / GAMMA)).astype(np.uint8)


def _gains(drawn: dict[str, NDArray[np.float64]]) -> NDArray[np.float32]:
    """Left and right ``(2, 3)``: differences are divided between both cameras."""
    half_2 = np.array([-0.5, 0.5])
    stops_2 = drawn["exposure"][0] + half_2 * drawn["exposure_difference"][0]
    balance_2 = drawn["white_balance"][0] + half_2 * drawn["white_balance_difference"][0]
    gains_23 = 2.0 ** (stops_2[:, None] + balance_2[:, None] * np.array([0.5, 0.0, -0.5]))
    return np.asarray(gains_23, np.float32)


def _falloff(K_33: NDArray[np.float64], height: int, width: int) -> NDArray[np.float32]:
    """cos^4 of the angle between each pixel's ray and the optical axis ``(H, W)``; crops know where they were."""
    x_W = (np.arange(width) - K_33[0, 2]) / K_33[0, 0]
    y_H = (np.arange(height) - K_33[1, 2]) / K_33[1, 1]
    return np.asarray((1 + x_W**2 + y_H[:, None] ** 2) ** -2.0, np.float32)


def _soften(picture_HW3: NDArray[np.float32], sigma: float) -> None:
    if sigma < 0.2:  # less than a hundredth of the light leaves a pixel
        return
    radius = int(3 * sigma + 1)
    gaussian_filter(picture_HW3, sigma, output=picture_HW3, mode="nearest", radius=radius, axes=(0, 1))


def _smear(picture_HW3: NDArray[np.float32], length: float, turn: float) -> None:
    """The mean along a line: shifts of the picture, interpolated."""
    count = 2 * int(np.ceil(length)) + 1
    if length < 0.3:
        return
    padding = int(np.ceil(length)) + 1
    padded = np.pad(picture_HW3, ((padding, padding), (padding, padding), (0, 0)), mode="edge")
    H, W = picture_HW3.shape[:2]
    total = np.zeros_like(picture_HW3)
    for share in np.linspace(-0.5, 0.5, count):
        y, x = padding + share * length * np.array([np.sin(turn), np.cos(turn)])
        i, j = int(np.floor(y)), int(np.floor(x))
        for row, down in ((i, 1 - (y - i)), (i + 1, y - i)):
            for column, across in ((j, 1 - (x - j)), (j + 1, x - j)):
                total += np.float32(down * across) * padded[row : row + H, column : column + W]
    picture_HW3[:] = total / count


def _compressed(picture_HW3: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    file = BytesIO()
    Image.fromarray(picture_HW3).save(file, "JPEG", quality=quality)
    return np.asarray(Image.open(file))
