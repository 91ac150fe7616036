"""Procedural bowls. The outer radius of the rim is about 1."""

import numpy as np
from manifold3d import CrossSection
from numpy.random import Generator

from stereo_occ.shapes import curves, solids
from stereo_occ.shapes.curves import Points
from stereo_occ.shapes.shape import Shape
from stereo_occ.shapes.vessel import vessel, wall_fraction

KINDS = ("hemispherical", "conical", "footed", "flared", "rimmed", "incurved", "oval", "rounded_square")
KIND_ODDS = (0.22, 0.14, 0.15, 0.12, 0.11, 0.06, 0.1, 0.1)


def bowl(rng: Generator, object_id: str) -> Shape:
    """A random bowl, not yet in the object frame."""
    kind = str(rng.choice(KINDS, p=KIND_ODDS))
    profile_N2 = _profile(rng, kind)
    thickness = wall_fraction(rng) * 2 * profile_N2[:, 0].max()
    body = vessel(
        profile_N2,
        thickness,
        floor=thickness * rng.uniform(0.9, 1.8),
        base_radius=rng.uniform(0.01, 0.06),
        cavity_radius=rng.uniform(0.02, 0.2),
        rim=rng.uniform(0.2, 0.45),
        level_rim=kind not in ("flared", "rimmed") and rng.random() < 0.5,
        foot=_foot(rng, kind, profile_N2),
    )
    solid = solids.lathe(body.wall, 72)
    if kind == "oval":
        solid = solids.with_section(solid, rng.uniform(2.0, 2.5), rng.uniform(0.6, 0.88))
    elif kind == "rounded_square":
        solid = solids.with_section(solid, rng.uniform(3.0, 6.0), rng.uniform(0.75, 1.0))
    mesh = solids.trimesh_of(solid)
    facts: dict[str, str | float | bool] = {
        "kind": kind,
        "handle": "none",
        "section": {"oval": "oval", "rounded_square": "rounded square"}.get(kind, "round"),
        "wall_thickness": thickness / float(mesh.extents.max()),
        "hollow": True,
    }
    return Shape(
        "bowl", object_id, mesh, {"floor": solids.trimesh_of(solids.slab(solid, -1.0, body.floor))}, facts
    )


def _profile(rng: Generator, kind: str) -> Points:
    """The outer profile from the base edge at height 0 to the rim at radius 1."""
    height = rng.uniform(0.4, 0.95)
    base = rng.uniform(0.3, 0.6)
    if kind == "conical":
        bend = rng.uniform(0, 0.12)
        middle = [(base + 1) / 2 + bend, height / 2 - bend]
        return curves.bezier([[base, 0], middle, [1, height]], 24)
    if kind == "flared":
        out = rng.uniform(0.7, 0.9)
        return curves.bezier(
            [[base, 0], [out, 0], [out * 0.95, height * 0.7], [0.92, height], [1, height * 1.02]], 32
        )
    if kind == "rimmed":
        well, brim = rng.uniform(0.65, 0.85), height * rng.uniform(0.5, 0.8)
        cup = curves.bezier([[base, 0], [well, 0], [well, 0.4 * brim], [well, brim]], 20)
        return curves.filleted([*cup, [1, brim * rng.uniform(1.0, 1.15)]], 0.06)
    if kind == "incurved":
        return curves.bezier(
            [[base, 0], [1.25, 0], [1.15, height * 0.9], [rng.uniform(0.7, 0.85), height]], 32
        )
    belly = rng.uniform(0.8, 1.05)
    return curves.bezier([[base, 0], [belly, 0], [1, height * rng.uniform(0.2, 0.6)], [1, height]], 32)


def _foot(rng: Generator, kind: str, profile_N2: Points) -> CrossSection | None:
    if kind != "footed" and rng.random() < 0.5:
        return None
    base, tall = profile_N2[0, 0], rng.uniform(0.08, 0.16) if kind == "footed" else rng.uniform(0.01, 0.04)
    return solids.rectangle((base * rng.uniform(0.72, 0.84), base * rng.uniform(0.92, 1.0)), (-tall, 0.06))
