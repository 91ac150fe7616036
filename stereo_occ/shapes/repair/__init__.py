"""Watertight solids from meshes as they are found, by the gentlest step that suffices."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from stereo_occ.errors import UserError
from stereo_occ.occupancy.enclosure import overlap
from stereo_occ.shapes.quality import bodies_and_genus, cavity, deviation, wall_thickness
from stereo_occ.shapes.repair.faces import drop_doubled, weld, weld_loosely
from stereo_occ.shapes.repair.gentle import assemble
from stereo_occ.shapes.repair.holes import close_openings
from stereo_occ.shapes.repair.topology import is_closed, wound_alike
from stereo_occ.shapes.repair.wrap import wrap

__all__ = ["Repair", "repair"]

#: More faces than this are refused.
MAX_FACES = 2_000_000
#: A mesh thinner than this share of its diagonal is a plate, no vessel.
FLAT = 0.02
#: Share of points at which a solid may overlap itself without being made anew.
MAX_OVERLAP = 2e-4
#: What counts as a vessel: the wall's thickness as a share of the diagonal, and the cavity's of the whole.
MAX_WALL, MIN_CAVITY = 0.1, 0.3
#: How far, in shares of the diagonal, the solid's surface may be from the mesh's.
MAX_MEAN_DEVIATION, MAX_P99_DEVIATION = 0.01, 0.04


@dataclass(frozen=True, eq=False)
class Repair:
    """A solid, what was done to get it, and how far it is from the mesh it was made of.

    Attributes:
        mesh: watertight, outward winding, in the frame of the input.
        steps: what was done, in order; empty for a mesh that is a solid already.
        measures: figures by name, lengths as shares of the diagonal: see :mod:`stereo_occ.shapes.quality`;
            ``volume_change`` as a share of the input's volume where that is closed, and ``sheet``, the share of
            the surface that had no thickness and got some.
    """

    mesh: Trimesh
    steps: tuple[str, ...]
    measures: Mapping[str, float]


def repair(mesh: Trimesh) -> Repair:
    """A watertight solid that is the object the mesh shows.

    In this order, each only where needed: weld vertices and drop collapsed faces; drop doubled faces; turn the
    faces of each piece alike; drop specks and sheets that lie on other parts; close pin-holes and ends of
    pieces that lie within others; turn bodies outward and voids inward; drop bodies hidden inside; join bodies
    that overlap; close a vessel's wall where its two sides do not meet. What then is no solid, or overlaps itself, is
    wrapped. The same mesh gives the same bytes.

    Raises:
        UserError: it cannot be one, or only one too far from the mesh; the message is the reason alone.
    """
    _check(mesh)
    welded, changed = weld(mesh)
    steps = ["welded vertices"] if changed else []
    if not len(welded.faces):
        raise UserError("has no triangle with three different corners")
    to_unit = _Frame(welded)
    unit = source = to_unit(welded)
    if not (_is_sound(unit) and unit.body_count == 1):
        unit, source, more = _solid(unit)
        if more:
            steps += more
            welded = to_unit.back(unit)
    measures = {**bodies_and_genus(unit), **wall_thickness(unit), **cavity(unit), **deviation(source, unit)}
    if is_closed(source.faces) and abs(source.volume) > 1e-9:
        measures["volume_change"] = unit.volume / abs(source.volume) - 1
    _check_deviation(measures)
    return Repair(welded, tuple(steps), measures)


def _solid(unit: Trimesh) -> tuple[Trimesh, Trimesh, list[str]]:
    """The solid of a welded mesh of diagonal 1, the surface it is meant to have, and what was done."""
    steps = []
    unit, doubled = drop_doubled(unit)
    if doubled:
        steps.append(f"dropped {doubled} doubled faces")
    unit, tolerance = weld_loosely(unit)
    if tolerance:
        steps.append(f"welded vertices {tolerance:g} of the diagonal apart")
    assembly, done = assemble(unit)
    if assembly is not None and _is_sound(assembly.solid):
        return (assembly.solid if done else unit), assembly.source, steps + done
    if (closed := _vessel(unit)) is not None:
        vessel, openings = closed
        return vessel, vessel, [*steps, f"closed {openings} openings between the sides of the wall"]
    solid, sheet = wrap(unit)
    steps.append("wrapped")
    if sheet > 0.01:
        steps.append(f"gave thickness to {100 * sheet:.0f} % of the surface")
    if not _is_sound(solid):
        raise UserError("gives no solid, even wrapped")
    return solid, unit, steps


def _vessel(unit: Trimesh) -> tuple[Trimesh, int] | None:
    """A thin wall around a cavity whose two sides do not meet everywhere, as where a scan lacks the base: closed there.

    None of any other mesh: what becomes no vessel when it is closed, as a cup of one sheet, is left to be wrapped.
    """
    wound = wound_alike(unit.faces)
    closed = close_openings(unit.vertices, wound[0]) if wound else None
    if closed is None:
        return None
    vertices_V3, faces_F3, openings = closed
    solid = Trimesh(vertices_V3, faces_F3, process=False)
    if solid.is_watertight and solid.volume < 0:
        solid.invert()
    if not _is_sound(solid) or wall_thickness(solid)["wall_median"] > MAX_WALL:
        return None
    return (solid, openings) if cavity(solid)["cavity"] >= MIN_CAVITY else None


class _Frame:
    """To a box of diagonal 1 around the origin, and back."""

    def __init__(self, mesh: Trimesh) -> None:
        self._centre_3, self._scale = mesh.bounds.mean(axis=0), float(mesh.scale)

    def __call__(self, mesh: Trimesh) -> Trimesh:
        return Trimesh((mesh.vertices - self._centre_3) / self._scale, mesh.faces, process=False)

    def back(self, mesh: Trimesh) -> Trimesh:
        return Trimesh(mesh.vertices * self._scale + self._centre_3, mesh.faces, process=False)


def _is_sound(mesh: Trimesh) -> bool:
    """Whether the mesh is a solid that hardly overlaps itself."""
    closed = mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 1e-9
    return bool(closed and overlap(mesh, RayMeshIntersector(mesh)) <= MAX_OVERLAP)


def _check(mesh: Trimesh) -> None:
    """Refuse what no repair can help."""
    if not len(mesh.faces):
        raise UserError("holds no triangles")
    if len(mesh.faces) > MAX_FACES:
        raise UserError(f"has {len(mesh.faces):,} faces, more than {MAX_FACES:,}: simplify it")
    used_3 = np.asarray(mesh.triangles).reshape(-1, 3)
    if not np.isfinite(used_3).all():
        raise UserError("has vertices that are not finite numbers")
    extents_3, largest = np.ptp(used_3, axis=0), np.abs(used_3).max()
    if largest > 1e100 or extents_3.max() <= 1e-6 * largest:
        raise UserError(
            f"has no shape that its numbers can hold: extent {extents_3.max():.3g}, coordinates up to {largest:.3g}"
        )
    diagonal = float(np.linalg.norm(extents_3))
    if extents_3.min() < FLAT * diagonal:
        raise UserError(
            f"encloses no volume: it is flat, {extents_3.min():.3g} in a box of diagonal {diagonal:.3g}"
        )


def _check_deviation(measures: Mapping[str, float]) -> None:
    """Refuse a solid that is another object."""
    for way, what in (("lost", "of the surface would be lost"), ("gained", "of the solid's surface is new")):
        mean, p99 = measures[f"{way}_mean"], measures[f"{way}_p99"]
        if mean > MAX_MEAN_DEVIATION or p99 > MAX_P99_DEVIATION:
            raise UserError(
                f"gives only a solid that is too far from it: 1 % {what}, {100 * p99:.1f} % of the diagonal "
                f"away or more (at most {100 * MAX_P99_DEVIATION:g}), {100 * mean:.2f} % on average "
                f"(at most {100 * MAX_MEAN_DEVIATION:g})"
            )
