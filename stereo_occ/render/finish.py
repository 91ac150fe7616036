"""How a surface looks: colours, gloss and the solid texture that the shader evaluates."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from trimesh.visual.color import srgb_to_linear


class Pattern(IntEnum):
    """Solid textures of two colours; the numbers are known to ``shaders/light.frag``."""

    plain = 0
    stripes = 1
    checks = 2
    clouds = 3
    marble = 4
    spots = 5
    glaze = 6  # the first colour up to a wavy line and outside, the second above it and inside
    label = 7  # a patch of the second colour with rows of ink
    own = 8  # the mesh's own colours


@dataclass(frozen=True, eq=False)
class Finish:
    """The look of one surface.

    Attributes:
        color_3: linear reflectance, 0 to 1.
        second_3: the pattern's other colour, where there is a pattern.
        metallic, roughness: 0 to 1.
        reflection: how strongly the surroundings are mirrored; 1 is a clean glaze.
        warp: how far the pattern is bent by noise, in periods.
        level: share of the second colour, or the height of a glaze's line.
        extra_4: of a label: lower and upper edge, middle and half width in radians about +Y. The last is below 0 for
            what is shaded where things stand.
        texture_from_object: 4x4, from the object's frame to pattern space, whose unit is a period.
    """

    color_3: NDArray[np.float64]
    second_3: NDArray[np.float64]
    metallic: float = 0.0
    roughness: float = 0.8
    reflection: float = 0.0
    pattern: Pattern = Pattern.plain
    warp: float = 0.0
    level: float = 0.5
    extra_4: NDArray[np.float64] = field(default_factory=lambda: np.zeros(4))
    texture_from_object: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))

    def packed(self) -> NDArray[np.float32]:
        """Four vectors of four ``(4, 4)``, as the shader takes them."""
        rows = [
            [*self.color_3, self.pattern],
            [*self.second_3, self.roughness],
            [self.metallic, self.reflection, self.warp, self.level],
            self.extra_4,
        ]
        return np.array(rows, np.float32)


def root_of_linear(srgb_V3: NDArray[np.number]) -> NDArray[np.float64]:
    """Own colours of a mesh as its vertices carry them: square roots of linear reflectances, from sRGB 0 to 255."""
    return np.asarray(np.sqrt(srgb_to_linear(srgb_V3 / 255)))
