"""What closes a bottle: caps, stoppers, nozzles, spray heads and pumps, on a neck whose top is at height 1."""

import numpy as np
from manifold3d import CrossSection, FillRule, Manifold
from numpy.random import Generator

from stereo_occ.shapes import curves, solids


def ring(rng: Generator, radius: float) -> CrossSection:
    """A lip or a collar around the neck near its top."""
    height, below = rng.uniform(0.012, 0.04), rng.uniform(0.0, 0.04)
    return solids.rectangle((0, radius * rng.uniform(1.12, 1.35)), (1 - below - height, 1 - below))


def cap(rng: Generator, radius: float) -> CrossSection:
    """A screw cap or crown over the neck."""
    width = radius * rng.uniform(1.06, 1.3)
    low, high = 1 - rng.uniform(0.02, 0.07), 1 + rng.uniform(0.01, 0.06)
    profile = np.array([[width, low], [width * rng.uniform(0.9, 1.0), high]])
    return solids.section_of(profile)


def nozzle(rng: Generator, radius: float) -> CrossSection:
    """A cap with a conical tip."""
    width, low, high = radius * rng.uniform(1.0, 1.2), 0.97, 1 + rng.uniform(0.02, 0.1)
    foot, tip = width * rng.uniform(0.35, 0.7), width * rng.uniform(0.12, 0.3)
    top = high + rng.uniform(0.08, 0.22)
    return solids.section_of(np.array([[width, low], [width, high], [foot, high + 0.02], [tip, top]]))


def spray_head(rng: Generator, radius: float) -> Manifold:
    """A trigger head: a collar, a wedge with its nozzle to +X and a curved trigger under it."""
    collar = radius * rng.uniform(1.15, 1.4)
    height, length, back = rng.uniform(0.08, 0.13), rng.uniform(0.14, 0.24), rng.uniform(0.04, 0.1)
    low = 1 + rng.uniform(0.02, 0.05)
    outline = [
        [-collar * 0.7, 1.0],
        [collar * 0.7, 1.0],
        [collar * 0.9, low],
        [length, low + 0.45 * height],
        [length, low + 0.85 * height],
        [-back, low + height],
        [-back - 0.02, low + 0.6 * height],
    ]
    side = solids.rounded(CrossSection([np.array(outline)], FillRule.NonZero), outward=0.012, inward=0.01)
    width = collar * rng.uniform(1.0, 1.5)
    head = side.extrude(width).translate((0, 0, -width / 2)).rotate((90, 0, 0))
    start = np.array([0.55 * length, low + 0.4 * height])
    drop = rng.uniform(0.1, 0.16)
    lever = curves.bezier(
        [start, start + [0.2 * length, -0.3 * drop], start + [0, -0.7 * drop], start + [0.1, -drop]], 16
    )
    sizes = np.tile([[0.011, 0.35 * width]], (16, 1))
    collar_ring = solids.lathe(solids.rectangle((0, collar), (0.95, 1.01)), 40)
    return head + solids.sweep(lever, sizes, 3.0, 12) + collar_ring


def pump(rng: Generator, radius: float) -> Manifold:
    """A lotion pump: a collar, a thin stem and a head whose spout points to +X."""
    collar, stem = radius * rng.uniform(1.1, 1.4), radius * rng.uniform(0.25, 0.45)
    top, reach = 1 + rng.uniform(0.07, 0.16), rng.uniform(0.1, 0.2)
    low = solids.rectangle((0, collar), (0.94, 1 + rng.uniform(0.01, 0.04)))
    head = solids.rectangle((0, 2 * stem), (top - 0.02, top + 0.015))
    turned = solids.lathe(low + head + solids.rectangle((0, stem), (0.97, top)), 40)
    spout = curves.filleted([[0, top], [0.8 * reach, top], [reach, top - 0.03]], 0.02)
    spout = curves.resampled(spout, 14)
    size = min(stem, 0.014)
    return turned + solids.sweep(spout, np.full((14, 2), size), 2.0, 12)


#: Lathe sections added to the neck, by closure; a plain neck has none.
TOPS = {"lip": ring, "cap": cap, "nozzle": nozzle}

#: Solids added to the neck, by closure.
HEADS = {"spray head": spray_head, "pump": pump}
