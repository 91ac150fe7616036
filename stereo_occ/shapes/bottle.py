"""Procedural bottles. The radius of the body is about 1."""

import numpy as np
from numpy.random import Generator

from stereo_occ.shapes import solids
from stereo_occ.shapes.shape import Shape

KINDS = ("wine", "soda", "flask", "jar", "jug", "spray")


def bottle(rng: Generator, object_id: str) -> Shape:
    """A random bottle, not yet in the object frame."""
    kind = str(rng.choice(KINDS))
    body, shoulder, neck = rng.uniform(2, 4), rng.uniform(0.4, 1.2), rng.uniform(0.5, 2)
    r = rng.uniform(0.25, 0.5)
    profile_N2 = np.array([[1, 0], [1, body], [r, body + shoulder], [r, body + shoulder + neck]])
    section = solids.rounded(solids.section_of(profile_N2), outward=rng.uniform(0.05, 0.2), inward=0.3)
    solid = solids.lathe(section)
    mesh = solids.trimesh_of(solid)
    parts = {
        "neck": solids.trimesh_of(solids.slab(solid, body + shoulder, 99)),
        "floor": solids.trimesh_of(solids.slab(solid, -1, 0.15)),
    }
    facts: dict[str, str | float | bool] = {"kind": kind, "section": "round", "hollow": False}
    return Shape("bottle", object_id, mesh, parts, facts)
