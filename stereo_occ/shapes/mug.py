"""Procedural mugs: a vessel of many profiles with, mostly, a handle. The height of the body is 1."""

import numpy as np
from manifold3d import CrossSection, Manifold
from numpy.random import Generator

from stereo_occ.shapes import curves, solids, warps
from stereo_occ.shapes.curves import Points
from stereo_occ.shapes.handle import HANDLES, SECTIONS, Handle, handle_tube
from stereo_occ.shapes.shape import Shape
from stereo_occ.shapes.vessel import vessel, wall_fraction

BODIES = ("straight", "tapered", "barrel", "waisted", "tulip", "footed", "flared")
BODY_ODDS = (0.29, 0.19, 0.13, 0.07, 0.12, 0.1, 0.1)
HANDLE_ODDS = {"C": 0.28, "D": 0.25, "ear": 0.2, "square": 0.14, "none": 0.13}


def mug(rng: Generator, object_id: str) -> Shape:
    """A random mug, not yet in the object frame."""
    body = str(rng.choice(BODIES, p=BODY_ODDS))
    kind = str(rng.choice(list(HANDLE_ODDS), p=list(HANDLE_ODDS.values())))
    profile_N2 = _profile(rng, body, kind != "none")
    handle = _handle(rng, kind, profile_N2) if kind in HANDLES else None
    width = 2 * profile_N2[:, 0].max() + (handle.clearance + handle.thickness if handle else 0)
    thickness = wall_fraction(rng) * max(1.0, width)
    cup = vessel(
        profile_N2,
        thickness,
        floor=thickness * rng.uniform(1.0, 2.0) + (0.05 if body == "footed" else 0),
        base_radius=rng.uniform(0.01, 0.08),
        cavity_radius=rng.uniform(0.02, 0.12),
        rim=rng.uniform(0.2, 0.45),
        foot=_foot(rng, profile_N2),
        lip=_lip(rng, profile_N2, thickness),
    )
    facets = int(rng.choice((6, 8, 10, 12, 16))) if rng.random() < 0.06 else 0
    exponent = rng.uniform(2.8, 5.0) if not facets and rng.random() < 0.05 else 2.0

    def turned(section: CrossSection, tolerance: float) -> Manifold:
        solid = solids.lathe(section, facets or 52, tolerance)
        return warps.with_section(solid, exponent, 1.0) if exponent > 2 else solid

    solid, parts = turned(cup.wall, 6e-4), {}
    if handle:
        tube = handle_tube(rng, handle, profile_N2, depth=thickness + handle.thickness)
        parts["handle"] = solids.trimesh_of(tube - turned(cup.hull, 1.5e-3))
        solid += tube - turned(cup.middle, 3e-3)
    parts["floor"] = solids.trimesh_of(solids.slab(solid, -1.0, cup.floor))
    mesh = solids.trimesh_of(solid)
    facts: dict[str, str | float | bool] = {
        "kind": body,
        "handle": kind,
        "handle_section": handle.section if handle else "none",
        "section": f"{facets} facets" if facets else "rounded square" if exponent > 2 else "round",
        "hollow": True,
        "wall_thickness": thickness / float(mesh.extents.max()),
    }
    return Shape("mug", object_id, mesh, parts, facts)


def _profile(rng: Generator, body: str, with_handle: bool) -> Points:
    """The outer profile of a body, from its base edge at height 0 to its rim at height 1."""
    r = 0.5 / (rng.uniform(0.8, 1.5) if with_handle else rng.uniform(0.9, 1.9))
    if body == "straight":
        return curves.monotone([0, 1], [r * rng.uniform(0.96, 1.02), r])
    if body == "tapered":
        low = rng.uniform(0.62, 0.9)
        middle = (1 + low) / 2 + rng.uniform(-0.02, 0.06)
        return curves.monotone([0, 0.5, 1], [r * low, r * middle, r])
    if body == "barrel":
        at, low = rng.uniform(0.35, 0.6), rng.uniform(0.72, 0.95)
        return curves.monotone([0, at, 1], [r * low, r * 1.03, r * rng.uniform(0.8, 0.97)])
    if body == "waisted":
        at = rng.uniform(0.4, 0.65)
        return curves.monotone([0, at, 1], [r * rng.uniform(0.92, 1.03), r * rng.uniform(0.8, 0.92), r])
    if body == "flared":
        low, at = rng.uniform(0.74, 0.94), rng.uniform(0.6, 0.85)
        return curves.monotone([0, at, 1], [r * low, r * (low + rng.uniform(0.0, 0.04)), r])
    if body == "footed":
        foot, rise = rng.uniform(0.5, 0.75), rng.uniform(0.04, 0.12)
        stem = foot * rng.uniform(0.82, 0.95)
        bowl = curves.bezier([[r * stem, rise], [r, rise], [r * rng.uniform(0.98, 1.1), 0.5], [r, 1]], 28)
        return np.concatenate([[[r * foot, 0], [r * foot, 0.4 * rise]], bowl])
    base = rng.uniform(0.35, 0.7)
    return curves.bezier(
        [[r * base, 0], [r * rng.uniform(0.95, 1.15), 0], [r, rng.uniform(0.3, 0.6)], [r, 1]], 32
    )


def _handle(rng: Generator, kind: str, profile_N2: Points) -> Handle:
    section = str(rng.choice(SECTIONS, p=(0.35, 0.35, 0.3)))
    thickness = rng.uniform(0.085, 0.15) if section != "flat" else rng.uniform(0.06, 0.11)
    top, bottom = rng.uniform(0.74, 0.9), rng.uniform(0.14, 0.34)
    return Handle(kind, section, top, bottom, clearance=rng.uniform(0.17, 0.34), thickness=thickness)


def _foot(rng: Generator, profile_N2: Points) -> CrossSection | None:
    """Half of the bodies stand on a ring."""
    if rng.random() < 0.5:
        return None
    base = profile_N2[0, 0]
    ring = solids.rectangle((base * rng.uniform(0.7, 0.86), base * rng.uniform(0.92, 0.97)), (-0.03, 0.1))
    return ring.translate((0, rng.uniform(0.0, 0.02)))


def _lip(rng: Generator, profile_N2: Points, thickness: float) -> CrossSection | None:
    """One rim in six is thickened by a bead."""
    if rng.random() > 1 / 6:
        return None
    size = thickness * rng.uniform(0.55, 0.85)
    return solids.bead(profile_N2[-1, 0] - thickness * rng.uniform(0.2, 0.5), 1 - size * 0.6, (size, size))
