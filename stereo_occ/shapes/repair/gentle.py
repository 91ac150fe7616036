"""Repair piece by piece, which keeps the mesh's own triangles wherever they are sound."""

from dataclasses import dataclass

import numpy as np
from trimesh import Trimesh

from stereo_occ.shapes.distance import spread
from stereo_occ.shapes.repair.bodies import Body, join, outward, side_by_side, sort_bodies, visible
from stereo_occ.shapes.repair.holes import Bodies, close_pin_holes
from stereo_occ.shapes.repair.topology import Faces, bad_edges, edge_keys, is_closed, pieces, wound_alike

#: Pieces whose box has a smaller diagonal (of the mesh's 1) are specks ...
SPECK = 0.01
#: ... which go if all of them together have no more than this share of the surface.
SPECKS_AREA = 0.02
#: More pieces than this are no parts of a household object but fragments.
MAX_PIECES = 200


@dataclass(frozen=True, eq=False)
class Assembly:
    """A solid, and the surfaces of the bodies it was made of before they were joined."""

    solid: Trimesh
    source: Trimesh


def assemble(mesh: Trimesh) -> tuple[Assembly | None, list[str]]:
    """The solid of a mesh whose pieces are closed, or nearly, and what was done; None where that fails.

    Args:
        mesh: welded, without doubled faces, its diagonal 1.
    """
    steps: list[str] = []
    found = pieces(mesh.faces)
    kept = _without_specks(mesh, found)
    if len(kept) < len(found):
        steps.append(f"dropped {len(found) - len(kept)} specks")
    if len(kept) > MAX_PIECES:
        return None, steps
    closed, opened, partitions = _peel(mesh, np.concatenate(kept))
    if partitions:
        steps.append(f"dropped {partitions} inner partitions")
    bodies = _bodies(mesh, closed)
    if bodies is None or not _close(mesh, opened, bodies, steps):
        return None, steps
    if not bodies:
        return None, steps
    solids, voids, decisions = sort_bodies(bodies)
    solid, cut = join(solids, voids)
    if cut:
        decisions.append(f"joined {len(solids) + len(voids)} bodies")
    if solid is None:
        return None, steps
    return Assembly(solid, side_by_side(solids, voids)), steps + decisions


def _without_specks(mesh: Trimesh, found: list[Faces]) -> list[Faces]:
    small = [
        bool(np.linalg.norm(np.ptp(mesh.vertices[piece_P3].reshape(-1, 3), axis=0)) < SPECK)
        for piece_P3 in found
    ]
    area = [_area(mesh, piece_P3) for piece_P3 in found]
    if sum(a for a, speck in zip(area, small, strict=True) if speck) > SPECKS_AREA * sum(area):
        return found
    return [piece_P3 for piece_P3, speck in zip(found, small, strict=True) if not speck]


def _area(mesh: Trimesh, faces_F3: Faces) -> float:
    a_F3, b_F3, c_F3 = mesh.vertices[faces_F3].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b_F3 - a_F3, c_F3 - a_F3), axis=1).sum() / 2)


def _peel(mesh: Trimesh, faces_F3: Faces) -> tuple[list[Faces], list[Faces], int]:
    """Closed pieces, open pieces, and the number of hidden partitions that went.

    Where more than two faces meet, closed pieces are taken off first: what they leave often fits together.
    """
    closed: list[Faces] = []
    partitions = 0
    while len(faces_F3):
        found = pieces(faces_F3)
        whole = [piece_P3 for piece_P3 in found if is_closed(piece_P3)]
        rest = [piece_P3 for piece_P3 in found if not is_closed(piece_P3)]
        if not whole:
            partition = _partition(mesh, faces_F3, rest)
            if partition is None:
                return closed, rest, partitions
            del rest[partition]
            partitions += 1
        closed += whole
        faces_F3 = np.concatenate(rest) if rest else faces_F3[:0]
    return closed, [], partitions


def _partition(mesh: Trimesh, faces_F3: Faces, rest: list[Faces]) -> int | None:
    """Index of a piece that hangs between others by all its border and cannot be seen from outside."""
    if len(rest) < 3 or not bad_edges(faces_F3)[1]:
        return None
    keys_E, uses_E = np.unique(edge_keys(faces_F3), return_counts=True)
    crowded_E = keys_E[uses_E > 2]
    seen = visible([Trimesh(mesh.vertices, piece_P3, process=False) for piece_P3 in rest])
    for index, piece_P3 in enumerate(rest):
        own_E, own_uses_E = np.unique(edge_keys(piece_P3), return_counts=True)
        if not seen[index] and np.isin(own_E[own_uses_E == 1], crowded_E).all():
            return index
    return None


def _bodies(mesh: Trimesh, closed: list[Faces]) -> list[Body] | None:
    """The bodies of closed pieces; None if one has one side only."""
    bodies = []
    for piece_P3 in closed:
        wound = wound_alike(piece_P3)
        if wound is None:
            return None
        body = outward(_of(mesh.vertices, wound[0]), wound[1])
        if body is not None:
            bodies.append(body)
    return bodies


def _close(mesh: Trimesh, opened: list[Faces], bodies: list[Body], steps: list[str]) -> bool:
    """Add what open pieces become to the bodies; False if one can neither be closed nor do without."""
    pin_holes = ends = sheets = 0
    waiting = sorted(opened, key=len, reverse=True)
    while waiting:
        held = Bodies([body.mesh for body in bodies])
        for piece_P3 in waiting:
            if bodies and held.hold(spread(mesh.vertices[piece_P3], 0.01)[0]):
                sheets += 1
                break
            wound = wound_alike(piece_P3)
            filled = close_pin_holes(mesh.vertices, wound[0], held) if wound else None
            if wound and filled and is_closed(filled[1]):
                body = outward(_of(filled[0], filled[1]), wound[1])
                if body is not None:
                    bodies.append(body)
                    pin_holes, ends = pin_holes + filled[2], ends + filled[3]
                    break
        else:
            return False
        waiting = [other for other in waiting if other is not piece_P3]
    if pin_holes:
        steps.append(f"closed {pin_holes} pin-holes")
    if ends:
        steps.append(f"closed {ends} ends within other parts")
    if sheets:
        steps.append(f"dropped {sheets} sheets that lie on other parts")
    return True


def _of(vertices_V3: np.ndarray, faces_F3: Faces) -> Trimesh:
    part = Trimesh(vertices_V3, faces_F3, process=False)
    part.remove_unreferenced_vertices()
    return part
