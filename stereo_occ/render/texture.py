"""Textures of objects: procedural ones in object space, or a mesh's own colours."""

from colorsys import hsv_to_rgb
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.ranges import draw, draw_log, share
from stereo_occ.render.appearance import Appearance
from stereo_occ.render.finish import Finish, Pattern

#: Patterns that a configuration may name.
PATTERNS = tuple(pattern.name for pattern in Pattern if pattern not in (Pattern.plain, Pattern.own))


COLOR = ("hue", "saturation", "value")


@dataclass
class TextureConfig:
    """Textures of the object; none where ``patterns`` is empty."""

    patterns: list[str] = field(default_factory=list)  # one of them is drawn per view pair
    share: float = 1.0  # of view pairs that have a pattern
    own: bool = False  # meshes that have colours of their own show them instead
    period: list[float] = field(default_factory=lambda: [0.1, 0.1])  # of the pattern, object diagonals
    warp: list[float] = field(default_factory=lambda: [0.0, 0.0])  # bends of the pattern, periods
    hue: list[float] = field(default_factory=lambda: [0.0, 1.0])  # of the second colour, as in material
    saturation: list[float] = field(default_factory=lambda: [0.0, 0.0])
    value: list[float] = field(default_factory=lambda: [0.5, 0.5])

    @property
    def off(self) -> bool:
        """Whether every object has one colour."""
        return not (self.patterns or self.own)


def draw_finish(
    config: TextureConfig, appearance: Appearance, has_colors: bool, rng: np.random.Generator
) -> Finish:
    """The finish of the object in one view pair: the appearance's material, with a texture.

    Raises:
        UserError: for a range out of its limits or an unknown pattern.
    """
    finish = plain_finish(appearance)
    second_3 = np.array(hsv_to_rgb(*(draw(getattr(config, name), f"texture.{name}", rng) for name in COLOR)))
    period = draw_log(config.period, "texture.period", rng, 1e-3, 10)
    warp = draw(config.warp, "texture.warp", rng, 0, 10)
    plain = rng.random() >= share(config.share, "texture.share")
    turn_33, offset_3 = random_rotations(1, rng)[0], rng.uniform(0, 64, 3)
    level, angle, low, height, width = rng.random(5)
    for name in config.patterns:
        if name not in PATTERNS:
            raise UserError(f"texture.patterns: '{name}' is none of {', '.join(PATTERNS)}")
    if config.own and has_colors:
        return replace(finish, pattern=Pattern.own)
    if plain or not config.patterns:
        return finish
    pattern = Pattern[config.patterns[int(rng.integers(len(config.patterns)))]]
    finish = replace(finish, second_3=second_3, pattern=pattern, warp=warp)
    if pattern is Pattern.glaze:
        return replace(finish, warp=min(0.1, 0.2 * warp), level=-0.3 + 0.6 * level)
    if pattern is Pattern.label:
        bottom = -0.35 + 0.3 * low
        edges = [bottom, bottom + 0.1 + 0.25 * height, 2 * np.pi * angle, 0.6 + 2.6 * width]
        return replace(finish, warp=0.0, extra_4=np.array(edges))
    return replace(finish, level=0.3 + 0.4 * level, texture_from_object=periodic(turn_33 / period, offset_3))


def plain_finish(appearance: Appearance) -> Finish:
    """The appearance's material, untextured."""
    return Finish(
        appearance.base_color_3,
        appearance.base_color_3,
        appearance.metallic,
        appearance.roughness,
        appearance.reflection,
    )


def periodic(linear_33: NDArray[np.float64], offset_3: NDArray[np.float64]) -> NDArray[np.float64]:
    """A 4x4 affine transform into pattern space."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear_33, offset_3
    return matrix
