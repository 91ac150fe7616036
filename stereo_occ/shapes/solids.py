"""Solids of the procedural objects, by manifold3d: lathed profiles and swept tubes.

While an object is built its axis is +Z and its handle points to +X; :func:`trimesh_of` turns +Z into +Y,
which is up in the object frame.
"""

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold, Mesh64
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.shapes import curves
from stereo_occ.shapes.curves import Points


def section_of(profile_N2: Points) -> CrossSection:
    """The lathe section of a profile from its lowest to its highest point: closed to the axis, mirrored.

    It is mirrored so that rounding leaves the points on the axis alone.
    """
    mirrored_N2 = profile_N2[::-1] * (-1.0, 1.0)
    return CrossSection([np.concatenate([profile_N2, mirrored_N2])], FillRule.NonZero)


def rectangle(radii: tuple[float, float], heights: tuple[float, float]) -> CrossSection:
    """The section of a ring between two radii (or of a disc, from radius 0) and two heights."""
    (inner, outer), (low, high) = radii, heights
    if inner <= 0:
        return section_of(np.array([[outer, low], [outer, high]]))
    right = np.array([[inner, low], [outer, low], [outer, high], [inner, high]])
    return CrossSection([right, right[::-1] * (-1.0, 1.0)])


def bead(radius: float, height: float, size: tuple[float, float]) -> CrossSection:
    """The section of a ring of elliptic section with half sizes ``size``, centred at a radius and height."""
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    right = np.stack([radius + size[0] * np.cos(angle), height + size[1] * np.sin(angle)], axis=1)
    return CrossSection([right, right[::-1] * (-1.0, 1.0)])


def offset(section: CrossSection, distance: float) -> CrossSection:
    """The section grown by a distance (shrunk where it is negative), with round corners."""
    return section.offset(distance, JoinType.Round, 2.0, 28).simplify(1e-4)


def rounded(section: CrossSection, outward: float = 0.0, inward: float = 0.0) -> CrossSection:
    """The section with its convex corners rounded to radius ``outward`` and its concave ones to ``inward``.

    A piece thinner than twice ``outward`` is lost, a gap narrower than twice ``inward`` is filled.
    """
    if outward > 0:
        section = offset(offset(section, -outward), outward)
    if inward > 0:
        section = offset(offset(section, inward), -inward)
    return section


def lathe(section: CrossSection, segments: int = 56, tolerance: float = 6e-4) -> Manifold:
    """The solid of revolution about +Z of a mirrored section, first simplified to a tolerance."""
    return section.simplify(tolerance).revolve(segments)


def sweep(path_N2: Points, half_sizes_N2: Points, exponent: float = 2.0, sides: int = 18) -> Manifold:
    """A capped tube along a path in the XZ plane.

    Args:
        path_N2: (x, z) points.
        half_sizes_N2: half the tube's size in the plane and across it (along Y) at each point.
        exponent: of the superellipse that is its section: 2 is an ellipse, 4 and more a rounded rectangle.
        sides: corners of the section.
    """
    tangent_N2 = np.gradient(path_N2, axis=0)
    tangent_N2 /= np.linalg.norm(tangent_N2, axis=1, keepdims=True)
    normal_N2 = tangent_N2[:, ::-1] * (-1.0, 1.0)
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    across_K, along_K = curves.superellipse(np.cos(angle), np.sin(angle), exponent)
    rings_NK3 = np.empty((len(path_N2), sides, 3))
    rings_NK3[..., [0, 2]] = (
        path_N2[:, None] + normal_N2[:, None] * (half_sizes_N2[:, :1] * across_K)[..., None]
    )
    rings_NK3[..., 1] = half_sizes_N2[:, 1:] * along_K
    return skin(rings_NK3)


def skin(rings_NK3: NDArray[np.float64]) -> Manifold:
    """The solid through a stack of rings that turn clockwise seen from the last one, closed by fans."""
    count, sides, _ = rings_NK3.shape
    index_NK = np.arange(count * sides).reshape(count, sides)
    following_NK = np.roll(index_NK, -1, axis=1)
    a, b, c, d = index_NK[:-1], following_NK[:-1], following_NK[1:], index_NK[1:]
    first, last = np.full(sides, count * sides), np.full(sides, count * sides + 1)
    triangles = [
        np.stack([a, c, b], axis=-1).reshape(-1, 3),
        np.stack([a, d, c], axis=-1).reshape(-1, 3),
        np.stack([index_NK[0], following_NK[0], first], axis=-1),
        np.stack([following_NK[-1], index_NK[-1], last], axis=-1),
    ]
    vertices = np.concatenate([rings_NK3.reshape(-1, 3), rings_NK3[[0, -1]].mean(axis=1)])
    return Manifold(Mesh64(vertices, np.concatenate(triangles).astype(np.uint64)))


def slab(solid: Manifold, low: float, high: float) -> Manifold:
    """The bounding box of a solid between two heights."""
    x0, y0, z0, x1, y1, z1 = solid.bounding_box()
    low, high = max(low, z0), min(high, z1)
    return Manifold.cube((x1 - x0, y1 - y0, high - low)).translate((x0, y0, low))


def trimesh_of(solid: Manifold) -> Trimesh:
    """The solid as a mesh with +Y up instead of +Z."""
    mesh = solid.to_mesh64()
    x, y, z = mesh.vert_properties[:, :3].T
    return Trimesh(np.stack([x, z, -y], axis=1), mesh.tri_verts.astype(np.int64), process=False)
