"""Colours of a surface from the photographs in which it is seen."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, map_coordinates
from scipy.spatial import cKDTree
from trimesh import Trimesh

from stereo_occ.calibration import RealCamera, RealPair


def vertex_colors(
    mesh: Trimesh,
    pair: RealPair,
    images: tuple[NDArray[np.uint8], NDArray[np.uint8]],
    masks: Sequence[NDArray[np.bool_] | None],
    clearance: float,
) -> NDArray[np.uint8]:
    """Display colours ``(V, 3)``: the mean of both photographs, by how squarely each sees the vertex.

    A vertex that neither sees takes the colour of the nearest one that is seen; grey if none is.

    Args:
        mesh: left camera's frame, metres.
        pair: fitted to ``images``.
        masks: of the object, where they are known; what lies at their edge or outside is not the object's colour.
        clearance: metres above the surface from which it is asked whether the camera is in sight.
    """
    weight_2V = np.zeros((2, len(mesh.vertices)))
    color_2V3 = np.zeros((2, len(mesh.vertices), 3))
    for index, (camera, image_HW3, mask_HW) in enumerate(zip(pair.cameras, images, masks, strict=True)):
        within_HW = np.ones(image_HW3.shape[:2], bool) if mask_HW is None else binary_erosion(mask_HW)
        weight_2V[index], color_2V3[index] = _seen(mesh, camera, image_HW3, within_HW, clearance)
    total_V = weight_2V.sum(axis=0)
    seen_V = total_V > 0
    if not seen_V.any():
        return np.full((len(mesh.vertices), 3), 128, dtype=np.uint8)
    color_V3 = (weight_2V[..., None] * color_2V3).sum(axis=0)
    color_V3[seen_V] /= total_V[seen_V, None]
    _, nearest = cKDTree(mesh.vertices[seen_V]).query(mesh.vertices[~seen_V])
    color_V3[~seen_V] = color_V3[seen_V][nearest]
    return np.asarray(np.rint(color_V3), dtype=np.uint8)


def _seen(
    mesh: Trimesh,
    camera: RealCamera,
    image_HW3: NDArray[np.uint8],
    within_HW: NDArray[np.bool_],
    clearance: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How squarely each vertex is seen, 0 where it is not, and the colour there."""
    height, width = image_HW3.shape[:2]
    towards_V3 = camera.center_3 - mesh.vertices
    towards_V3 /= np.linalg.norm(towards_V3, axis=1, keepdims=True)
    square_V = np.einsum("vi,vi->v", towards_V3, mesh.vertex_normals)
    pixels_V2 = camera.pixels(np.asarray(mesh.vertices))
    inside_V: NDArray[np.bool_] = np.all((pixels_V2 >= 0) & (pixels_V2 <= [width - 1, height - 1]), axis=1)
    inside_V[inside_V] = within_HW[tuple(np.rint(pixels_V2[inside_V]).astype(np.intp).T[::-1])]
    facing = np.flatnonzero((square_V > 0.05) & inside_V)
    origins_N3 = mesh.vertices[facing] + clearance * mesh.vertex_normals[facing]
    hidden_N = mesh.ray.intersects_any(origins_N3, towards_V3[facing])
    weight_V = np.zeros(len(square_V))
    weight_V[facing] = np.where(hidden_N, 0, square_V[facing] ** 2)
    color_V3 = np.stack(
        [map_coordinates(channel.astype(np.float32), pixels_V2.T[::-1], order=1, mode="nearest")
         for channel in np.moveaxis(image_HW3, 2, 0)], axis=-1,
    )  # fmt: skip
    return weight_V, color_V3
