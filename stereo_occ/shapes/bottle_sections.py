"""Horizontal sections of bottles: round, oval, rounded rectangular or faceted."""

from dataclasses import dataclass

import numpy as np
from manifold3d import CrossSection, Manifold
from numpy.random import Generator

from stereo_occ.shapes import solids, warps
from stereo_occ.shapes.bottle_profiles import Silhouette
from stereo_occ.shapes.curves import Points

#: Odds of a round, an oval and a rounded rectangular section.
SECTION_ODDS = {
    "wine": (0.92, 0.0, 0.08),
    "soda": (0.88, 0.0, 0.12),
    "flask": (0.0, 0.45, 0.55),
    "jar": (0.75, 0.0, 0.25),
    "jug": (0.35, 0.2, 0.45),
    "spray": (0.35, 0.3, 0.35),
    "squeeze": (0.45, 0.4, 0.15),
}


@dataclass(frozen=True)
class Section:
    """The horizontal section of the body: a superellipse that turns round between shoulder and neck."""

    name: str
    exponent: float
    aspect: float
    facets: int

    def turned(self, section: CrossSection, outline: Silhouette) -> Manifold:
        """The solid with a lathe section."""
        solid = solids.lathe(section, self.facets or 48)
        if self.exponent == 2 and self.aspect == 1:
            return solid

        def weight(height: Points) -> Points:
            t = np.clip((outline.neck - height) / (outline.neck - 0.8 * outline.shoulder), 0, 1)
            return t * t * (3 - 2 * t)

        return warps.with_section(solid, self.exponent, self.aspect, weight)


def draw_section(rng: Generator, kind: str) -> Section:
    """A random section for a kind of bottle; round bodies are sometimes made of flat facets."""
    shape = str(rng.choice(("round", "oval", "rounded rectangle"), p=SECTION_ODDS[kind]))
    if shape == "oval":
        return Section(shape, rng.uniform(2.0, 2.6), rng.uniform(0.5, 0.85), 0)
    if shape == "rounded rectangle":
        flat = rng.uniform(0.4, 0.75) if kind == "flask" else rng.uniform(0.55, 1.0)
        return Section(shape, rng.uniform(3.5, 9.0), flat, 0)
    facets = int(rng.choice((6, 8, 10, 12))) if rng.random() < 0.06 else 0
    return Section(f"{facets} facets" if facets else shape, 2.0, 1.0, facets)
