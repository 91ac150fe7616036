"""What closes a bottle: caps, nozzles, spray heads and pumps, on a neck whose top is at height 1."""

import numpy as np
from manifold3d import CrossSection, FillRule, Manifold
from numpy.random import Generator

from stereo_occ.shapes import curves, solids
from stereo_occ.shapes.bottle_profiles import Silhouette


def lip(rng: Generator, outline: Silhouette) -> CrossSection:
    """A lip or a collar around the neck near its top."""
    height, below = rng.uniform(0.012, 0.04), rng.uniform(0.0, 0.04)
    return solids.rectangle(
        (0, outline.neck_radius * rng.uniform(1.12, 1.35)), (1 - below - height, 1 - below)
    )


def cap(rng: Generator, outline: Silhouette) -> CrossSection:
    """A screw cap or crown over some or all of the neck, no wider than the body."""
    radius = outline.neck_radius
    width = max(min(radius * rng.uniform(1.06, 1.3), outline.radius), 1.03 * radius)
    low, high = _covered(rng, outline), 1 + rng.uniform(0.01, 0.05)
    return solids.section_of(np.array([[width, low], [width * rng.uniform(0.92, 1.0), high]]))


def nozzle(rng: Generator, outline: Silhouette) -> CrossSection:
    """A cap with a conical tip."""
    width, high = outline.neck_radius * rng.uniform(1.03, 1.15), 1 + rng.uniform(0.0, 0.06)
    foot, tip = width * rng.uniform(0.3, 0.65), width * rng.uniform(0.12, 0.28)
    top = high + rng.uniform(0.08, 0.22)
    low = _covered(rng, outline)
    profile = [[width, low], [width, high], [foot, high + rng.uniform(0.005, 0.04)], [tip, top]]
    return solids.section_of(np.array(profile))


def _covered(rng: Generator, outline: Silhouette) -> float:
    """The height down to which a cap covers the neck."""
    return max(1 - rng.uniform(0.35, 0.95) * (1 - outline.neck), 0.86)


def spray_head(rng: Generator, outline: Silhouette) -> Manifold:
    """A trigger head: a collar, a wedge with its nozzle to +X and a curved trigger under it."""
    collar = outline.neck_radius * rng.uniform(1.15, 1.4)
    height, back = rng.uniform(0.08, 0.13), rng.uniform(0.04, 0.1)
    length = collar + rng.uniform(0.1, 0.18)
    low = 1 + rng.uniform(0.02, 0.05)
    profile = [
        [-collar * 0.7, 1.0],
        [collar * 0.7, 1.0],
        [collar * 0.9, low],
        [length, low + 0.45 * height],
        [length, low + 0.85 * height],
        [-back, low + height],
        [-back - 0.02, low + 0.6 * height],
    ]
    side = solids.rounded(CrossSection([np.array(profile)], FillRule.NonZero), outward=0.012, inward=0.01)
    width = collar * rng.uniform(1.0, 1.5)
    head = side.extrude(width).translate((0, 0, -width / 2)).rotate((90, 0, 0))
    x, z = collar + 0.035, low + 0.4 * height
    drop = rng.uniform(0.1, 0.16)
    control = [[x, z], [x + 0.2 * length, z - 0.3 * drop], [x, z - 0.7 * drop], [x + 0.1, z - drop]]
    lever = curves.bezier(control, 16)
    sizes = np.tile([[0.011, 0.35 * width]], (16, 1))
    collar_ring = solids.lathe(solids.rectangle((0, collar), (0.95, 1.01)), 40)
    return head + solids.sweep(lever, sizes, 3.0, 12) + collar_ring


def pump(rng: Generator, outline: Silhouette) -> Manifold:
    """A lotion pump: a collar, a thin stem and a head whose spout points to +X."""
    collar, stem = outline.neck_radius * rng.uniform(1.1, 1.4), outline.neck_radius * rng.uniform(0.25, 0.45)
    top, reach = 1 + rng.uniform(0.07, 0.16), rng.uniform(0.1, 0.2)
    low = solids.rectangle((0, collar), (0.94, 1 + rng.uniform(0.01, 0.04)))
    head = solids.rectangle((0, 2 * stem), (top - 0.02, top + 0.015))
    turned = solids.lathe(low + head + solids.rectangle((0, stem), (0.97, top)), 40)
    spout = curves.filleted([[0, top], [0.8 * reach, top], [reach, top - 0.03]], 0.02)
    spout = curves.resampled(spout, 14)
    size = min(stem, 0.014)
    return turned + solids.sweep(spout, np.full((14, 2), size), 2.0, 12)


#: Lathe sections added to the neck, by closure; a plain neck has none.
TOPS = {"lip": lip, "cap": cap, "nozzle": nozzle}

#: Solids added to the neck, by closure.
HEADS = {"spray head": spray_head, "pump": pump}
