"""What a view pair looks like: lights, material, background; see also ``texture``, ``clutter`` and ``sensor``.

A config gives ranges ``[low, high]``; :func:`draw_appearance` draws one value from each. A fixed value is a range of
no width. Reflectance is linear; the background, which is not lit, is in display values (what an image file holds).
"""

from collections.abc import Sequence
from colorsys import hsv_to_rgb
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from omegaconf import MISSING

from stereo_occ.ranges import bounds, draw
from stereo_occ.render.clutter import Clutter, ClutterConfig
from stereo_occ.render.finish import Finish

#: The shader's limit on directional lights.
MAX_LIGHTS = 4

#: The shader encodes reflected light for display by this power.
GAMMA = 2.2


@dataclass
class LightSourceConfig:
    """A directional light, its direction in the rig frame."""

    azimuth_deg: list[float] = MISSING  # where it comes from: about +Y, 0 at +Z (cameras), 90 at +X (right)
    elevation_deg: list[float] = MISSING  # where it comes from: above the XZ plane
    intensity: list[float] = MISSING  # pi shows a white matt surface that faces the light as white


@dataclass
class LightsConfig:
    """Directional lights and a uniform ambient light."""

    count: list[int] = MISSING  # how many of the sources are on, in their order; both ends included
    ambient: list[float] = MISSING  # radiance of a white surface that no source reaches
    warmth: list[float] = MISSING  # of each source: red is (1 + warmth), blue (1 - warmth) times green
    sources: dict[str, LightSourceConfig] = MISSING
    shadows: list[float] | None = None  # half width of their edges, object diagonals; null: nothing casts any


@dataclass
class MaterialConfig:
    """A metallic-roughness material of one colour."""

    hue: list[float] = MISSING  # 0 to 1, red to red
    saturation: list[float] = MISSING  # 0 to 1
    value: list[float] = MISSING  # 0 to 1: the largest of the three linear reflectances
    metallic: list[float] = MISSING  # 0 to 1
    roughness: list[float] = MISSING  # 0 to 1
    reflection: list[float] | None = None  # how strongly windows and lamps are mirrored; 1: a clean glaze


@dataclass
class BackgroundConfig:
    """One colour behind the object."""

    low: list[float] = MISSING  # red, green, blue display values, 0 to 1
    high: list[float] = MISSING
    contrast: float = MISSING  # least distance in display RGB from the object's base colour
    masked: float = (
        0.0  # share of view pairs where that colour replaces all but the object, after the cameras
    )
    clutter: ClutterConfig | None = None  # things in place of the colour


@dataclass(frozen=True, eq=False)
class Appearance:
    """The values of one view pair.

    Attributes:
        light_from_L3: unit vectors towards the lights, rig frame.
        light_color_L3: linear RGB times intensity.
        ambient: radiance of a white surface that no light reaches.
        base_color_3: linear reflectance, 0 to 1.
        metallic, roughness: 0 to 1.
        background_3: uint8 display RGB.
        reflection: how strongly windows and lamps are mirrored.
        shadow: half width of shadows' edges, diagonals of the object; None: nothing casts any.
        finish: of the object with its texture; None: one colour.
        clutter: what is around the object; None: nothing.
    """

    light_from_L3: NDArray[np.float64]
    light_color_L3: NDArray[np.float64]
    ambient: float
    base_color_3: NDArray[np.float64]
    metallic: float
    roughness: float
    background_3: NDArray[np.uint8]
    reflection: float = 0.0
    shadow: float | None = None
    finish: Finish | None = None
    clutter: Clutter | None = None

    @property
    def plain(self) -> bool:
        """Whether pyrender can draw it: one colour, nothing around, nothing mirrored, no shadows."""
        return self.finish is None and self.clutter is None and self.shadow is None and not self.reflection


def draw_appearance(
    lights: LightsConfig, material: MaterialConfig, background: BackgroundConfig, rng: np.random.Generator
) -> Appearance:
    """Draw the appearance of one view pair; the same state of ``rng`` gives the same appearance.

    Raises:
        UserError: for a range that is not ``[low, high]`` within its bounds, or too few or too many lights.
    """
    fewest, most = bounds(lights.count, "lights.count", 0, min(len(lights.sources), MAX_LIGHTS))
    count = int(rng.integers(int(fewest), int(most), endpoint=True))
    ambient = draw(lights.ambient, "lights.ambient", rng, 0, np.inf)
    sources = [
        _draw_source(lights.sources[name], f"lights.sources.{name}", lights.warmth, rng)
        for name in list(lights.sources)[:count]
    ]
    hsv = [draw(getattr(material, name), f"material.{name}", rng) for name in ("hue", "saturation", "value")]
    base_color_3 = np.array(hsv_to_rgb(*hsv))
    return Appearance(
        light_from_L3=np.array([direction_3 for direction_3, _ in sources]).reshape(-1, 3),
        light_color_L3=np.array([color_3 for _, color_3 in sources]).reshape(-1, 3),
        ambient=ambient,
        base_color_3=base_color_3,
        metallic=draw(material.metallic, "material.metallic", rng),
        roughness=draw(material.roughness, "material.roughness", rng),
        background_3=_draw_background(background, base_color_3, rng),
        reflection=0.0
        if material.reflection is None
        else draw(material.reflection, "material.reflection", rng, 0, 5),
        shadow=None if lights.shadows is None else draw(lights.shadows, "lights.shadows", rng, 0, 0.2),
    )


def _draw_source(
    source: LightSourceConfig, name: str, warmth: Sequence[float], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    azimuth = np.radians(draw(source.azimuth_deg, f"{name}.azimuth_deg", rng, -360, 360))
    elevation = np.radians(draw(source.elevation_deg, f"{name}.elevation_deg", rng, -90, 90))
    intensity = draw(source.intensity, f"{name}.intensity", rng, 0, np.inf)
    tint = draw(warmth, "lights.warmth", rng, -1, 1)
    level = np.cos(elevation)
    direction_3 = np.array([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)])
    return direction_3, intensity * np.array([1 + tint, 1, 1 - tint])


def _draw_background(
    background: BackgroundConfig, base_color_3: NDArray[np.float64], rng: np.random.Generator, tries: int = 32
) -> NDArray[np.uint8]:
    """The first of ``tries`` colours that is far enough from the object's, else the farthest."""
    ranges = [bounds(pair, "background", 0, 1) for pair in zip(background.low, background.high, strict=True)]
    low_3, high_3 = np.array(ranges).T
    colors_T3 = rng.uniform(low_3, high_3, (tries, 3))
    distance_T = np.linalg.norm(colors_T3 - base_color_3 ** (1 / GAMMA), axis=1)
    far_T = distance_T >= background.contrast
    color_3: NDArray[np.float64] = colors_T3[np.argmax(far_T if far_T.any() else distance_T)]
    return np.rint(255 * color_3).astype(np.uint8)
