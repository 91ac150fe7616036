"""Colours of a mesh file, carried over to the vertices of the solid that is made of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from trimesh import Trimesh
from trimesh.visual import TextureVisuals
from trimesh.visual.color import linear_to_srgb, srgb_to_linear, to_float, to_rgba, uv_to_color
from trimesh.visual.material import PBRMaterial

#: Where a part of an object that has colours has none itself.
GREY = np.array([200, 200, 200], dtype=np.uint8)

#: Points whose colours are known, beside the vertices.
SAMPLES = 50_000


@dataclass(frozen=True, eq=False)
class SurfaceColors:
    """Places on a surface ``(N, 3)`` and their colours ``(N, 3)``, sRGB."""

    places_N3: NDArray[np.float64]
    colors_N3: NDArray[np.uint8]

    def at(self, points_M3: NDArray[np.floating]) -> NDArray[np.uint8]:
        """The colour of the nearest place for each of the points ``(M, 3)``."""
        _, nearest_M = KDTree(self.places_N3).query(points_M3)
        return np.asarray(self.colors_N3[nearest_M])


def surface_colors(parts: list[Trimesh]) -> SurfaceColors | None:
    """Colours of the parts of a scene at their vertices and at random points; None if no part has any.

    Textures are looked up, materials without one give their colour, transparency is ignored.
    """
    if not any(_has_colors(part) for part in parts):
        return None
    area = sum(part.area for part in parts)
    rng = np.random.default_rng(0)
    places: list[NDArray[np.float64]] = []
    colors: list[NDArray[np.uint8]] = []
    for part in parts:
        count = int(SAMPLES * part.area / area) if area > 0 else 0
        face_N = (
            rng.choice(len(part.faces), count, p=part.area_faces / part.area) if count else np.zeros(0, int)
        )
        weights_N3 = rng.dirichlet(np.ones(3), count)
        places += [part.vertices, np.einsum("nk,nkd->nd", weights_N3, part.triangles[face_N])]
        colors += _part_colors(part, face_N, weights_N3)
    return SurfaceColors(np.concatenate(places), np.concatenate(colors))


def _has_colors(part: Trimesh) -> bool:
    visual: Any = part.visual
    return not _is_default(visual) if isinstance(visual, TextureVisuals) else visual.kind is not None


def _is_default(visual: TextureVisuals) -> bool:
    """Whether trimesh put a grey material in place of one that is missing: 2 by 2 pixels."""
    material = visual.material
    image = getattr(material, "image", None)
    return not isinstance(material, PBRMaterial) and image is not None and image.size == (2, 2)


def _part_colors(
    part: Trimesh, face_N: NDArray[np.integer], weights_N3: NDArray[np.floating]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Colours of a part's vertices ``(V, 3)``, and of points given by face and barycentric weights ``(N, 3)``."""
    visual: Any = part.visual
    corners_N3 = part.faces[face_N]
    if not _has_colors(part):
        vertex_V3, point_N3 = np.tile(GREY, (len(part.vertices), 1)), np.tile(GREY, (len(face_N), 1))
    elif isinstance(visual, TextureVisuals):
        vertex_V3, point_N3 = _material_colors(part, corners_N3, weights_N3)
    elif visual.kind == "face":
        vertex_V3, point_N3 = visual.vertex_colors, visual.face_colors[face_N]
    else:
        vertex_V3 = visual.vertex_colors
        point_N3 = np.einsum("nk,nkd->nd", weights_N3, vertex_V3[corners_N3]).round().astype(np.uint8)
    return vertex_V3[:, :3], point_N3[:, :3]


def _material_colors(
    part: Trimesh, corners_N3: NDArray[np.integer], weights_N3: NDArray[np.floating]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Colours of a part's vertices ``(V, 3)``, and of points given by their corners and weights ``(N, 3)``.

    glTF multiplies, in linear light, a material's texture with its factor and with the colours of the vertices, each
    white where there is none.
    """
    visual: Any = part.visual
    material, uv_V2 = visual.material, visual.uv
    is_gltf = isinstance(material, PBRMaterial)
    picture = material.baseColorTexture if is_gltf else material.image
    if picture is not None and uv_V2 is not None:
        uv_N2 = np.einsum("nk,nkd->nd", weights_N3, uv_V2[corners_N3])
        vertex_V3, point_N3 = (uv_to_color(uv, picture)[:, :3] for uv in (uv_V2, uv_N2))
    else:
        flat_3 = np.array([255, 255, 255] if is_gltf else material.main_color[:3], dtype=np.uint8)
        vertex_V3, point_N3 = (np.tile(flat_3, (count, 1)) for count in (len(part.vertices), len(corners_N3)))
    if is_gltf and "color" in visual.vertex_attributes:
        shade_V3 = to_float(to_rgba(visual.vertex_attributes["color"]))[:, :3]
        shade_N3 = np.einsum("nk,nkd->nd", weights_N3, shade_V3[corners_N3])
        vertex_V3, point_N3 = (
            _times(vertex_V3, srgb_to_linear(shade_V3)),
            _times(point_N3, srgb_to_linear(shade_N3)),
        )
    if is_gltf and material.baseColorFactor is not None:
        factor_3 = to_float(material.baseColorFactor)[:3]
        vertex_V3, point_N3 = _times(vertex_V3, factor_3), _times(point_N3, factor_3)
    return vertex_V3, point_N3


def _times(colors_N3: NDArray[np.uint8], factor: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours made darker by a factor of linear light."""
    return np.rint(255 * linear_to_srgb(srgb_to_linear(colors_N3) * factor)).astype(np.uint8)
