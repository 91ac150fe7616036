"""Solids of the procedural objects, by manifold3d: lathed profiles, swept tubes, warped sections.

While an object is built its axis is +Z and its handle points to +X; :func:`trimesh_of` turns +Z into +Y,
which is up in the object frame.
"""

from collections.abc import Callable

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold, Mesh64
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.shapes.curves import Points

#: Large compared with any object: they are built with sides of about one.
FAR = 10.0


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
    across_K, along_K = superellipse(np.cos(angle), np.sin(angle), exponent)
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


def superellipse(
    cos_N: NDArray[np.float64], sin_N: NDArray[np.float64], exponent: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The point of the unit superellipse |x|^n + |y|^n = 1 in each direction given by its cosine and sine."""
    length_N = (np.abs(cos_N) ** exponent + np.abs(sin_N) ** exponent) ** (-1 / exponent)
    return cos_N * length_N, sin_N * length_N


def with_section(
    solid: Manifold, exponent: float, aspect: float, weight: Callable[[Points], Points] | None = None
) -> Manifold:
    """A lathed solid whose round section becomes a superellipse, with the same width along X.

    Args:
        solid: around +Z.
        exponent: 2 is an ellipse; 4 and more a rounded rectangle.
        aspect: depth along Y over width along X.
        weight: from heights to how far the section is changed there, 0 (round) to 1; everywhere 1 by default.
    """

    def warp(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points_N3.T
        radius = np.hypot(x, y)
        on_axis = radius < 1e-12
        cos, sin = np.where(on_axis, 1, x) / np.where(on_axis, 1, radius), y / np.where(on_axis, 1, radius)
        new_cos, new_sin = superellipse(cos, sin, exponent)
        share = np.ones_like(z) if weight is None else weight(z)
        new_x = x + share * (new_cos * radius - x)
        new_y = y + share * (aspect * new_sin * radius - y)
        return np.stack([new_x, new_y, z], axis=1)

    return solid.warp_batch(warp)


def leaning(solid: Manifold, start: float, slope: float) -> Manifold:
    """The solid sheared towards +X above a height, smoothly up to a slope at its top."""
    top = solid.bounding_box()[5]

    def warp(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points_N3.T
        return np.stack([x + slope * np.maximum(z - start, 0) ** 2 / (2 * (top - start)), y, z], axis=1)

    return solid.warp_batch(warp)


def scalloped(solid: Manifold, lobes: int, depth: float) -> Manifold:
    """A lathed solid whose radius waves around the axis, by nothing at its base and ``depth`` at its top."""
    base, top = solid.bounding_box()[2], solid.bounding_box()[5]

    def warp(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points_N3.T
        wave = 1 + depth * np.cos(lobes * np.arctan2(y, x)) * (z - base) / (top - base)
        return np.stack([x * wave, y * wave, z], axis=1)

    return solid.warp_batch(warp)


def peaked(solid: Manifold, rise: float) -> Manifold:
    """A lathed solid stretched upwards in its four diagonal directions, by ``rise`` times the height."""
    base = solid.bounding_box()[2]

    def warp(points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points_N3.T
        diagonal = np.sin(2 * np.arctan2(y, x)) ** 2
        return np.stack([x, y, z + rise * diagonal * np.maximum(z - base, 0) ** 2], axis=1)

    return solid.warp_batch(warp)


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
