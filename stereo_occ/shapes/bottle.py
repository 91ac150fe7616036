"""Procedural bottles: a body with a neck, a closure and sometimes a handle; mostly solid."""

import numpy as np
from manifold3d import CrossSection, Manifold
from numpy.random import Generator

from stereo_occ.shapes import bottle_tops, solids, warps
from stereo_occ.shapes.bottle_profiles import Silhouette, silhouette
from stereo_occ.shapes.bottle_sections import draw_section
from stereo_occ.shapes.handle import HANDLES, SECTIONS, Handle, handle_tube
from stereo_occ.shapes.shape import Shape
from stereo_occ.shapes.vessel import OPEN, Vessel, wall_fraction

KIND_ODDS = {
    "wine": 0.24,
    "soda": 0.19,
    "flask": 0.13,
    "jar": 0.12,
    "jug": 0.12,
    "spray": 0.1,
    "squeeze": 0.1,
}

CLOSURES: dict[str, dict[str, float]] = {
    "wine": {"lip": 0.65, "cap": 0.2, "plain": 0.15},
    "soda": {"cap": 0.55, "lip": 0.3, "plain": 0.15},
    "flask": {"cap": 0.6, "lip": 0.2, "plain": 0.2},
    "jar": {"cap": 0.75, "lip": 0.15, "plain": 0.1},
    "jug": {"cap": 0.75, "lip": 0.25},
    "spray": {"spray head": 0.45, "pump": 0.35, "cap": 0.2},
    "squeeze": {"nozzle": 0.8, "cap": 0.2},
}


def bottle(rng: Generator, object_id: str) -> Shape:
    """A random bottle, not yet in the object frame."""
    kind = str(rng.choice(list(KIND_ODDS), p=list(KIND_ODDS.values())))
    outline = silhouette(rng, kind)
    section = draw_section(rng, kind)
    closure = str(rng.choice(list(CLOSURES[kind]), p=list(CLOSURES[kind].values())))
    hollow = rng.random() < 0.22
    thickness = float(np.clip(wall_fraction(rng), 0.0125, 0.4 * outline.neck_radius)) if hollow else 0.0
    body = _body(rng, outline, closure, thickness)
    solid = section.turned(body.wall, outline)
    if closure in bottle_tops.HEADS:
        solid += bottle_tops.HEADS[closure](rng, outline)
    parts, handle = {}, "none"
    if kind == "jug" and rng.random() < 0.75:
        handle = str(rng.choice(("grip", *HANDLES))) if not hollow else str(rng.choice(HANDLES))
        if handle == "grip":
            hole, around = _grip(rng, outline)
            solid -= hole
            handle_solid = solid ^ around
        else:
            hull = section.turned(body.hull, outline)
            tube = _handle_tube(rng, handle, outline, thickness)
            solid, handle_solid = solid + (tube - section.turned(body.middle, outline)), tube - hull
        parts["handle"] = solids.trimesh_of(handle_solid)
    if kind == "squeeze" and rng.random() < 0.2:
        solid = warps.leaning(solid, rng.uniform(0.85, 1.0) * outline.shoulder, rng.uniform(0.3, 0.8))
    parts["neck"] = solids.trimesh_of(solids.slab(solid, outline.neck, 1.0))
    parts["floor"] = solids.trimesh_of(solids.slab(solid, -1.0, body.floor))
    mesh = solids.trimesh_of(solid)
    facts: dict[str, str | float | bool] = {
        "kind": kind,
        "handle": handle,
        "section": section.name,
        "closure": closure,
        "hollow": hollow,
    }
    if hollow:
        facts["wall_thickness"] = thickness / float(mesh.extents.max())
    return Shape("bottle", object_id, mesh, parts, facts)


def _body(rng: Generator, outline: Silhouette, closure: str, thickness: float) -> Vessel:
    """The lathe sections of the body with its cap or lip; solid where the wall thickness is 0."""
    beyond = [[outline.neck_radius, OPEN]]
    tall = solids.section_of(np.concatenate([outline.profile_N2, beyond]))
    tall = solids.rounded(
        tall, outward=min(rng.uniform(0.04, 0.35) * outline.radius, 0.9 * outline.neck_radius)
    )
    hull = tall ^ solids.rectangle((0, OPEN), (-1, 1))
    top = bottle_tops.TOPS.get(closure)
    if top is not None:
        hull += top(rng, outline)
    punt = rng.uniform(0.004, 0.03) if rng.random() < 0.6 else 0.0
    if punt:
        hull -= solids.bead(0.0, 0.0, (0.75 * outline.profile_N2[0, 0], punt))
    hull = solids.rounded(hull, outward=rng.uniform(0.003, 0.01), inward=rng.uniform(0.003, 0.015))
    if not thickness:
        return Vessel(hull, hull, solids.offset(tall, -0.01), 0.05)
    floor = punt + thickness * rng.uniform(1.0, 1.8)
    ceiling = OPEN if closure in ("lip", "plain") else 0.965
    cavity = solids.offset(tall, -thickness) ^ solids.rectangle((0, OPEN), (floor, ceiling))
    wall = hull - solids.rounded(cavity, outward=0.2 * thickness)
    wall = solids.rounded(wall, outward=0.35 * thickness)
    return Vessel(wall, hull, solids.offset(tall, -thickness / 2), floor)


def _handle_tube(rng: Generator, kind: str, outline: Silhouette, thickness: float) -> Manifold:
    """The handle of a jug, from its neck or shoulder to its side."""
    top = outline.shoulder + rng.uniform(0.4, 1.2) * (outline.neck - outline.shoulder)
    bottom = outline.shoulder * rng.uniform(0.45, 0.8)
    size = rng.uniform(0.05, 0.085)
    handle = Handle(kind, str(rng.choice(SECTIONS)), min(top, 0.9), bottom, rng.uniform(0.06, 0.14), size)
    return handle_tube(
        rng, handle, outline.profile_N2, depth=thickness + min(size, 0.8 * outline.neck_radius)
    )


def _grip(rng: Generator, outline: Silhouette) -> tuple[Manifold, Manifold]:
    """A hole through the body that leaves a strip to hold, and the region of that strip."""
    strip = rng.uniform(0.035, 0.06)
    low = outline.shoulder * rng.uniform(0.4, 0.65)
    high = outline.shoulder + rng.uniform(0.2, 0.6) * (outline.neck - outline.shoulder)
    inner = rng.uniform(0.15, 0.4) * outline.radius
    within = solids.offset(solids.section_of(outline.profile_N2), -strip)
    opening = within ^ CrossSection([np.array([[inner, low], [1, low], [1, high], [inner, high]])])
    opening = solids.rounded(opening, outward=0.02)
    hole = opening.extrude(2.0).translate((0, 0, -1.0)).rotate((90, 0, 0))
    middle = (opening.bounds()[0] + opening.bounds()[2]) / 2
    around = Manifold.cube((1.0, 2.0, high - low)).translate((middle, -1.0, low))
    return hole, around
