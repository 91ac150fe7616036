"""Procedural bowls: a vessel of many profiles and sections. The radius of the rim is about 1."""

from manifold3d import CrossSection, Manifold
from numpy.random import Generator

from stereo_occ.shapes import curves, solids, warps
from stereo_occ.shapes.curves import Points
from stereo_occ.shapes.shape import Shape
from stereo_occ.shapes.vessel import vessel, wall_fraction

KIND_ODDS = {
    "hemispherical": 0.2,
    "conical": 0.14,
    "footed": 0.16,
    "flared": 0.12,
    "rimmed": 0.09,
    "incurved": 0.07,
    "oval": 0.1,
    "rounded square": 0.12,
}


def bowl(rng: Generator, object_id: str) -> Shape:
    """A random bowl, not yet in the object frame."""
    kind = str(rng.choice(list(KIND_ODDS), p=list(KIND_ODDS.values())))
    profile_N2 = _profile(rng, kind)
    thickness = wall_fraction(rng) * 2 * profile_N2[:, 0].max()
    body = vessel(
        profile_N2,
        thickness,
        floor=thickness * rng.uniform(1.0, 2.2),
        base_radius=rng.uniform(0.01, 0.06),
        cavity_radius=rng.uniform(0.03, 0.25),
        rim=rng.uniform(0.15, 0.45),
        level_rim=kind not in ("flared", "rimmed", "incurved") and rng.random() < 0.5,
        foot=_foot(rng, kind, profile_N2),
    )
    solid, section = _turned(rng, kind, body.wall)
    mesh = solids.trimesh_of(solid)
    facts: dict[str, str | float | bool] = {
        "kind": kind,
        "handle": "none",
        "section": section,
        "hollow": True,
        "wall_thickness": thickness / float(mesh.extents.max()),
    }
    parts = {"floor": solids.trimesh_of(solids.slab(solid, -1.0, body.floor))}
    return Shape("bowl", object_id, mesh, parts, facts)


def _turned(rng: Generator, kind: str, wall: CrossSection) -> tuple[Manifold, str]:
    """The solid and the name of its horizontal section."""
    style = rng.random()
    if style < 0.08 and kind not in ("oval", "rounded square"):
        facets = int(rng.choice((6, 8, 10, 12, 16)))
        return solids.lathe(wall, facets), f"{facets} facets"
    solid = solids.lathe(wall, 64, tolerance=1.2e-3)
    if kind == "oval":
        return warps.with_section(solid, rng.uniform(2.0, 2.5), rng.uniform(0.6, 0.88)), "oval"
    if kind == "rounded square":
        solid = warps.with_section(solid, rng.uniform(2.8, 7.0), rng.uniform(0.75, 1.0))
        return (warps.peaked(solid, rng.uniform(0.08, 0.3)) if style < 0.35 else solid), "rounded square"
    if style < 0.16 and kind != "incurved":
        lobes = int(rng.integers(5, 13))
        return warps.scalloped(solid, lobes, rng.uniform(0.1, 0.4) / lobes), "scalloped"
    return solid, "round"


def _profile(rng: Generator, kind: str) -> Points:
    """The outer profile from the base edge at height 0 to the rim."""
    height = rng.uniform(0.36, 1.02)
    base = rng.uniform(0.28, 0.6)
    if kind == "conical":
        bend = rng.uniform(0, 0.14)
        return curves.bezier([[base, 0], [(base + 1) / 2 + bend, height / 2 - bend], [1, height]], 24)
    if kind == "flared":
        out, lip = rng.uniform(0.75, 0.92), rng.uniform(0.9, 1.0)
        control = [[base, 0], [out, 0], [out, height * 0.7], [out, height * lip], [1, height]]
        return curves.bezier(control, 32)
    if kind == "rimmed":
        well, brim = rng.uniform(0.65, 0.88), height * rng.uniform(0.5, 0.9)
        cup = curves.bezier([[base, 0], [well, 0], [well, 0.4 * brim], [well, brim]], 20)
        return curves.filleted([*cup, [1, brim * rng.uniform(1.0, 1.15)]], 0.06)
    if kind == "incurved":
        height, inward = rng.uniform(0.55, 1.0), rng.uniform(0.7, 0.9)
        return curves.bezier([[base, 0], [1.25, 0], [1.15, height * 0.9], [inward, height]], 32)
    if kind == "footed":
        base = rng.uniform(0.3, 0.5)
        lift = rng.uniform(0.05, 0.25) * height
        belly = rng.uniform(0.65, 0.9)
        return curves.bezier([[base, 0], [belly, lift], [1, height * rng.uniform(0.3, 0.7)], [1, height]], 32)
    belly = rng.uniform(0.7, 1.05)
    lift = rng.uniform(0, 0.12) * height
    return curves.bezier([[base, 0], [belly, lift], [1, height * rng.uniform(0.2, 0.7)], [1, height]], 32)


def _foot(rng: Generator, kind: str, profile_N2: Points) -> CrossSection | None:
    """A foot ring: always under a footed bowl, low and half the time under the others."""
    if kind != "footed" and rng.random() < 0.5:
        return None
    base, tall = profile_N2[0, 0], rng.uniform(0.07, 0.18) if kind == "footed" else rng.uniform(0.01, 0.04)
    return solids.rectangle((base * rng.uniform(0.68, 0.82), base * rng.uniform(0.92, 1.0)), (-tall, 0.06))
