"""Closed pieces of a mesh, what each is to the others, and the one solid that they make."""

from dataclasses import dataclass

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from stereo_occ.occupancy.contains import contains
from stereo_occ.occupancy.enclosure import directions

#: A body this large in its container, wound the same way, is the container's inner wall; a smaller one content.
INNER_WALL = 0.3
#: Offset of a ray's start from the surface it leaves, the mesh's diagonal being 1.
CLEARANCE = 1e-5


@dataclass(frozen=True, eq=False)
class Body:
    """A closed piece.

    Attributes:
        mesh: outward, whatever it was.
        sense: how it was wound: 1 outward, -1 inward, 0 both ways.
    """

    mesh: Trimesh
    sense: int


def outward(mesh: Trimesh, was_mixed: bool) -> Body | None:
    """The body of a closed mesh with consistent winding; None if it encloses nothing."""
    with np.errstate(invalid="ignore"):  # trimesh divides by the volume for the centre of mass
        volume = float(mesh.volume)
    if abs(volume) < 1e-12:
        return None
    if volume < 0:
        mesh.invert()
    return Body(mesh, 0 if was_mixed else int(np.sign(volume)))


def sort_bodies(bodies: list[Body]) -> tuple[list[Body], list[Body], list[str]]:
    """The solid bodies, the voids in them, and what had to be decided.

    A body within an odd number of others is a void if it is wound against the outermost, or both ways, or is
    large enough to be its container's inner wall; otherwise it is content of a solid and does not matter. A
    body that nobody outside can see, in a void, is content too, and is dropped: a full bottle stays hollow.
    """
    steps = []
    holders = [[other for other in bodies if other is not body and _within(body, other)] for body in bodies]
    outer = sum(
        body.sense * body.mesh.volume for body, around in zip(bodies, holders, strict=True) if not around
    )
    way = -1 if outer < 0 else 1
    solids: list[Body] = []
    voids: list[Body] = []
    dropped = 0
    for body, around in zip(bodies, holders, strict=True):
        if len(around) % 2 == 0:
            solids.append(body)
        elif body.sense * way <= 0 or body.mesh.volume > INNER_WALL * min(o.mesh.volume for o in around):
            voids.append(body)
        else:
            dropped += 1
    turned = sum(body.sense != 1 for body in solids) + sum(body.sense != -1 for body in voids)
    if turned:
        steps.append(f"turned {turned} of {len(bodies)} bodies")
    if len(solids) > 1:
        seen = visible([body.mesh for body in bodies])
        hidden = [body for body in solids if not seen[bodies.index(body)]]
        if hidden and len(hidden) < len(solids):
            dropped += len(hidden)
            solids = [body for body in solids if body not in hidden]
    if dropped:
        steps.append(f"dropped {dropped} bodies hidden inside")
    return solids, voids, steps


def visible(parts: list[Trimesh], samples: int = 100, count: int = 64) -> list[bool]:
    """Which parts can be seen from outside: some ray from the part escapes without meeting any of them."""
    rays = RayMeshIntersector(_together(parts))
    direction_D3 = directions(count)
    return [_escapes(rays, part, direction_D3, samples) for part in parts]


def _escapes(
    rays: RayMeshIntersector, part: Trimesh, direction_D3: NDArray[np.float64], samples: int
) -> bool:
    chosen = np.unique(np.linspace(0, len(part.faces) - 1, samples).astype(int))
    for side in (1, -1):
        start_P3 = part.triangles_center[chosen] + side * CLEARANCE * part.face_normals[chosen]
        origins_N3 = np.repeat(start_P3, len(direction_D3), axis=0)
        towards_N3 = np.tile(direction_D3, (len(start_P3), 1))
        if not rays.intersects_any(origins_N3, towards_N3).all():
            return True
    return False


def join(solids: list[Body], voids: list[Body]) -> tuple[Trimesh | None, bool]:
    """One solid of all bodies, and whether parts of them had to be cut away; None if some body resists.

    Bodies that do not meet are kept as they are. Others are added and subtracted from the largest to the
    smallest, so that what stands in a void stays.
    """
    signed = sorted(
        [(body, 1) for body in solids] + [(body, -1) for body in voids], key=lambda b: -b[0].mesh.volume
    )
    if len(signed) == 1:
        return signed[0][0].mesh, False
    total = Manifold()
    for body, sign in signed:
        part = Manifold(Mesh64(body.mesh.vertices, body.mesh.faces.astype(np.uint64)))
        if part.status() != Error.NoError:
            return None, False
        total = total + part if sign > 0 else total - part
    if np.isclose(total.volume(), sum(sign * body.mesh.volume for body, sign in signed), rtol=1e-9, atol=0):
        return side_by_side(solids, voids), False
    result = total.to_mesh64()
    if not len(result.tri_verts):
        return None, False
    return Trimesh(result.vert_properties[:, :3], result.tri_verts.astype(int), process=False), True


def side_by_side(solids: list[Body], voids: list[Body]) -> Trimesh:
    """The surfaces of all bodies, those of voids inward."""
    inward = [body.mesh.copy() for body in voids]
    for mesh in inward:
        mesh.invert()
    return _together([body.mesh for body in solids] + inward)


def _together(meshes: list[Trimesh]) -> Trimesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Trimesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        process=False,
    )


def _within(body: Body, other: Body) -> bool:
    """Whether nearly all of a body lies inside another one."""
    low, high = other.mesh.bounds
    if (body.mesh.bounds[0] < low - CLEARANCE).any() or (body.mesh.bounds[1] > high + CLEARANCE).any():
        return False
    chosen = np.unique(np.linspace(0, len(body.mesh.faces) - 1, 200).astype(int))
    return bool(contains(other.mesh, body.mesh.triangles_center[chosen]).mean() > 0.95)
