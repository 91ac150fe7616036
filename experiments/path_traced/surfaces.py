"""What things are made of: reflectances are linear, roughness is that of Disney's principled material."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_occ.ranges import draw_log
from stereo_occ.render.pictured import PHOTOGRAPHS, photograph

#: Of a dark glaze, linear.
DARK = (0.01, 0.08)


@dataclass(frozen=True, eq=False)
class Surface:
    """An opaque material.

    Attributes:
        color_3: linear reflectance.
        roughness: 0.05 mirrors nearly; 1 is matt, without any gloss.
        coated: clear plastic over a matt base (Mitsuba's ``roughplastic``) in place of ``principled``.
        metallic: 0 or 1.
        picture_HW3: sRGB, in place of the colour.
        tile: metres that the picture spans; beyond, its mirror image follows.
        own: the mesh's vertex colours in place of the colour.
    """

    color_3: NDArray[np.float64]
    roughness: float = 0.6
    coated: bool = False
    metallic: float = 0.0
    picture_HW3: NDArray[np.uint8] | None = None
    tile: float = 1.0
    own: bool = False


def glaze(dark: bool, rng: np.random.Generator, roughness: tuple[float, float] = (0.05, 0.35)) -> Surface:
    """Of one colour: nearly black, or anything from medium to white."""
    value = draw_log(DARK if dark else (0.15, 0.75), "glaze", rng)
    return Surface(_tinted(value, rng), draw_log(roughness, "roughness", rng), rng.random() < 0.5)


def own_colors(rng: np.random.Generator) -> Surface:
    """The mesh's own, glossy or not."""
    return Surface(np.full(3, 0.5), draw_log((0.1, 0.6), "roughness", rng), own=True)


def anything(rng: np.random.Generator) -> Surface:
    """Of a thing on the desk: printed, metal, plastic or matt."""
    kind = rng.choice(["printed", "metal", "plastic", "matt"], p=[0.25, 0.1, 0.35, 0.3])
    if kind == "printed":
        return printed(draw_log((0.05, 0.25), "tile", rng), rng)
    if kind == "metal":
        return Surface(_tinted(0.6, rng, 0.2), draw_log((0.12, 0.4), "roughness", rng), metallic=1.0)
    color_3 = _tinted(draw_log((0.02, 0.7), "reflectance", rng), rng, 0.9)
    return Surface(color_3, draw_log((0.1, 0.4), "roughness", rng) if kind == "plastic" else 1.0)


def printed(tile: float, rng: np.random.Generator) -> Surface:
    """A photograph that scikit-image brings along, as wide as ``tile`` metres."""
    name = PHOTOGRAPHS[int(rng.integers(len(PHOTOGRAPHS)))]
    roughness = draw_log((0.25, 0.8), "roughness", rng)
    return Surface(np.full(3, 0.5), roughness, picture_HW3=photograph(name), tile=tile)


def desk_top(rng: np.random.Generator) -> Surface:
    """Wood, one colour, or a photograph (a printed cloth or mat)."""
    kind = rng.choice(["wood", "plain", "printed"], p=[0.45, 0.25, 0.3])
    if kind == "printed":
        return printed(float(rng.uniform(0.3, 0.7)), rng)
    roughness = draw_log((0.2, 0.8), "roughness", rng)
    if kind == "plain":
        return Surface(_tinted(draw_log((0.05, 0.75), "reflectance", rng), rng, 0.3), roughness)
    return Surface(np.full(3, 0.5), roughness, picture_HW3=wood(rng), tile=1.0)


def wall_paint(rng: np.random.Generator) -> Surface:
    """Matt and light."""
    return Surface(_tinted(float(rng.uniform(0.35, 0.8)), rng, 0.25), 1.0)


def wood(rng: np.random.Generator, side: int = 768) -> NDArray[np.uint8]:
    """Boards with grain along the first axis of the picture ``(side, side, 3)``, sRGB."""
    x_W = np.linspace(0, 1, side)
    along_H1 = x_W[:, None]
    wave_HW = np.zeros((side, side))
    for _ in range(6):
        frequency, phase = rng.uniform(0.5, 4), rng.uniform(0, 2 * np.pi, 2)
        wave_HW += rng.uniform(0.1, 0.5) * np.sin(
            frequency * along_H1 * 2 + phase[0] + 3 * np.sin(6 * x_W + phase[1])
        )
    rings_HW = 0.5 + 0.5 * np.sin(2 * np.pi * (rng.uniform(12, 40) * x_W + wave_HW))
    fibre_HW = np.repeat(rng.random((side // 24, side)), 24, axis=0)
    boards_W = rng.uniform(0.8, 1.1, 8)[(x_W * 7.999).astype(int)]
    value_HW = (0.75 + 0.2 * rings_HW + 0.12 * fibre_HW) * boards_W
    value_HW[:, np.flatnonzero(np.diff((x_W * 7.999).astype(int)))] *= 0.5
    dark, base_3 = rng.uniform(0.35, 1.0), np.array([205.0, 150.0, 100.0])
    return np.asarray((base_3 * dark * value_HW[..., None]).clip(0, 255), np.uint8)


def _tinted(value: float, rng: np.random.Generator, most: float = 0.8) -> NDArray[np.float64]:
    """A colour whose brightest channel has that reflectance; ``most``: how much less the darkest may have."""
    return value * (1 - rng.uniform(0, most) * rng.permutation([0.0, rng.random(), 1.0]))
