"""Colours of a mesh file, carried over to the vertices of the solid that is made of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from trimesh import Trimesh
from trimesh.visual import TextureVisuals
from trimesh.visual.color import linear_to_srgb, uv_to_color
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
        material, uv_V2 = visual.material, visual.uv
        picture = material.baseColorTexture if isinstance(material, PBRMaterial) else material.image
        if picture is None or uv_V2 is None:
            color_3 = _flat_color(visual)
            vertex_V3, point_N3 = (
                np.tile(color_3, (len(part.vertices), 1)),
                np.tile(color_3, (len(face_N), 1)),
            )
        else:
            vertex_V3 = uv_to_color(uv_V2, picture)
            point_N3 = uv_to_color(np.einsum("nk,nkd->nd", weights_N3, uv_V2[corners_N3]), picture)
    elif visual.kind == "face":
        vertex_V3, point_N3 = visual.vertex_colors, visual.face_colors[face_N]
    else:
        vertex_V3 = visual.vertex_colors
        point_N3 = np.einsum("nk,nkd->nd", weights_N3, vertex_V3[corners_N3]).round().astype(np.uint8)
    return vertex_V3[:, :3], point_N3[:, :3]


def _flat_color(visual: TextureVisuals) -> NDArray[np.uint8]:
    """The one colour of a material; glTF states it in linear light."""
    color_3 = visual.material.main_color[:3]
    if isinstance(visual.material, PBRMaterial):
        return np.rint(255 * linear_to_srgb(color_3)).astype(np.uint8)
    return np.asarray(color_3, dtype=np.uint8)
