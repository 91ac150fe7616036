"""Watertight solids from meshes as they are found, by the gentlest step that suffices."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.shapes.repair.faces import weld

__all__ = ["Repair", "repair"]

#: More faces than this are refused.
MAX_FACES = 2_000_000


@dataclass(frozen=True, eq=False)
class Repair:
    """A solid, what was done to get it, and how far it is from the mesh it was made of.

    Attributes:
        mesh: watertight, outward winding, in the frame of the input.
        steps: what was done, in order; empty for a clean mesh.
        measures: figures by name.
    """

    mesh: Trimesh
    steps: tuple[str, ...]
    measures: Mapping[str, float] = field(default_factory=dict)


def repair(mesh: Trimesh) -> Repair:
    """A watertight solid that is the object of the mesh.

    Raises:
        UserError: it cannot be one; the message is the reason alone.
    """
    if not len(mesh.faces):
        raise UserError("holds no triangles")
    if len(mesh.faces) > MAX_FACES:
        raise UserError(f"has {len(mesh.faces)} faces, more than {MAX_FACES}: simplify it first")
    if not np.isfinite(mesh.vertices).all():
        raise UserError("has vertices that are not finite numbers")
    steps = []
    solid, changed = weld(mesh)
    if changed:
        steps.append("welded vertices")
    _, uses = np.unique(solid.edges_sorted, axis=0, return_counts=True)
    if not solid.is_watertight:
        raise UserError(
            f"not watertight: of {len(uses)} edges {(uses == 1).sum()} border a hole "
            f"and {(uses > 2).sum()} join more than two faces"
        )
    if not solid.is_winding_consistent:
        solid.fix_normals(multibody=False)
        steps.append("made the winding consistent")
    if not solid.is_winding_consistent:
        raise UserError("its faces cannot all be turned outward (a one-sided surface)")
    with np.errstate(invalid="ignore"):  # trimesh divides by the volume for the centre of mass
        volume = solid.volume
    if abs(volume) <= 1e-9 * solid.scale**3:
        raise UserError(f"encloses no volume ({volume:.3g} in a box of diagonal {solid.scale:.3g})")
    if volume < 0:
        solid.invert()
        steps.append("turned inside out")
    return Repair(solid, tuple(steps))
