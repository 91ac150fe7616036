"""The outline of a surface over the photographs that it was made from."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import binary_dilation
from trimesh import Trimesh

from stereo_occ.calibration import RealPair
from stereo_occ.geometry.camera import Camera
from stereo_occ.geometry.crop import Box
from stereo_occ.photographs.photo import seen_by

PANEL = 480  # pixels

COLOR = (255, 0, 170)
BOX_COLOR = (255, 200, 0)


def preview(
    mesh: Trimesh,
    pair: RealPair,
    images: tuple[NDArray[np.uint8], NDArray[np.uint8]],
    boxes: Sequence[Box] | None,
    views: tuple[Camera, Camera],
) -> NDArray[np.uint8]:
    """Both photographs with the mesh's outline; below them, larger, what the model was given of each.

    Args:
        mesh: left camera's frame, metres.
        pair: fitted to ``images``.
        boxes: where the object was found, drawn too.
        views: cameras of what the model was given, left camera's frame.
    """
    columns = []
    for index, (camera, image_HW3, view) in enumerate(zip(pair.cameras, images, views, strict=True)):
        scale = PANEL / image_HW3.shape[1]
        whole = Image.fromarray(image_HW3).resize((PANEL, max(1, round(scale * image_HW3.shape[0]))))
        pixels_V2 = (camera.pixels(np.asarray(mesh.vertices)) + 0.5) * scale - 0.5
        top = outlined(np.asarray(whole), pixels_V2, mesh, camera.center_3)
        if boxes is not None:
            top = _boxed(top, boxes[index], scale)
        large = view.resized(PANEL, PANEL)
        below = np.rint(seen_by(image_HW3, camera, large)).astype(np.uint8)
        pixels_V2 = large.project(np.asarray(mesh.vertices))[0]
        columns.append((top, outlined(below, pixels_V2, mesh, camera.center_3)))
    height = max(top.shape[0] for top, _ in columns)
    padded = [
        np.concatenate([np.pad(top, ((0, height - len(top)), (0, 0), (0, 0))), below])
        for top, below in columns
    ]
    return np.concatenate(padded, axis=1)


def silhouette(
    pixels_V2: NDArray[np.float64],
    faces_F3: NDArray[np.integer],
    facing_F: NDArray[np.bool_],
    width: int,
    height: int,
) -> NDArray[np.bool_]:
    """Pixels ``(height, width)`` covered by the faces that face the camera."""
    canvas = Image.new("1", (width, height))
    draw = ImageDraw.Draw(canvas)
    for triangle in pixels_V2[faces_F3[facing_F]].reshape(-1, 6).tolist():
        draw.polygon(triangle, fill=1)
    return np.asarray(canvas)


def outlined(
    image_HW3: NDArray[np.uint8], pixels_V2: NDArray[np.float64], mesh: Trimesh, center_3: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """The picture with a mesh's outline drawn.

    Args:
        pixels_V2: where the mesh's vertices appear.
        center_3: the camera's optical centre in the mesh's frame.
    """
    height, width = image_HW3.shape[:2]
    facing_F = np.einsum("fi,fi->f", mesh.face_normals, center_3 - mesh.triangles_center) > 0
    mask_HW = silhouette(pixels_V2, mesh.faces, facing_F, width, height)
    line_HW = binary_dilation(mask_HW, np.ones((5, 5))) & ~mask_HW
    drawn = image_HW3.copy()
    drawn[line_HW] = COLOR
    return drawn


def _boxed(image_HW3: NDArray[np.uint8], box: Box, scale: float) -> NDArray[np.uint8]:
    image = Image.fromarray(image_HW3)
    edges = (np.array([box.left, box.top, box.right, box.bottom]) + 0.5) * scale - 0.5
    ImageDraw.Draw(image).rectangle(edges.tolist(), outline=BOX_COLOR)
    return np.asarray(image)
