"""Photographs with what was made of them."""

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation
from trimesh import Trimesh

from experiments.whole_pairs import Photographs
from stereo_occ.geometry.camera import toed_in_rig, transform_points
from stereo_occ.photographs.outline import outlined
from stereo_occ.pictures import PANEL, picture

#: Degrees about the vertical axis from the left camera's side to the side that is shown, and from above.
TURN, DOWN = 120.0, 30.0


def panel(photographs: Photographs, mesh: Trimesh) -> NDArray[np.uint8]:
    """The left photograph with the mesh's outline; beside it the mesh and the true one from another side.

    Args:
        mesh: left camera's frame, metres.
    """
    scale = 2 * PANEL / photographs.rgb_2HW3.shape[2]
    camera = photographs.pair.left
    size = 2 * PANEL, round(scale * photographs.rgb_2HW3.shape[1])
    small = np.asarray(Image.fromarray(photographs.rgb_2HW3[0]).resize(size))
    pixels_V2 = (camera.pixels(np.asarray(mesh.vertices)) + 0.5) * scale - 0.5
    drawn = outlined(small, pixels_V2, mesh, np.asarray(camera.center_3))
    sides = [_from_behind(part, photographs) for part in (mesh, photographs.true_mesh)]
    height = max(PANEL, len(drawn))
    columns = [
        np.pad(part, ((0, height - len(part)), (0, 4), (0, 0)), constant_values=255)
        for part in (drawn, *sides)
    ]
    return np.concatenate(columns, axis=1)


def sheet(rows: Sequence[Sequence[NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Panels below each other, a column for each of the sequences."""
    panels = [panel for row in rows for panel in row]
    if not panels:
        return np.full((1, 1, 3), 255, np.uint8)
    height = max(len(row) for row in rows) * (len(panels[0]) + 4)
    columns = []
    for row in rows:
        padded = [np.pad(panel, ((0, 4), (0, 8), (0, 0)), constant_values=255) for panel in row]
        column = np.concatenate(padded) if padded else np.zeros((0, panels[0].shape[1] + 8, 3), np.uint8)
        columns.append(np.pad(column, ((0, height - len(column)), (0, 0), (0, 0)), constant_values=255))
    return np.concatenate(columns, axis=1)


def _from_behind(mesh: Trimesh, photographs: Photographs) -> NDArray[np.uint8]:
    """A mesh of the left camera's frame, upright, from a side that the cameras do not see."""
    object_from_left = np.linalg.inv(photographs.left_from_object)
    camera_3 = object_from_left[:3, 3]
    facing = np.degrees(np.arctan2(camera_3[0], camera_3[2]))
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("yx", [TURN - facing, DOWN], degrees=True).as_matrix()
    points_V3 = transform_points(np.asarray(mesh.vertices), turn @ object_from_left)
    return picture(Trimesh(points_V3, mesh.faces, process=False), toed_in_rig(1.0, pi / 16, pi / 3, 64))
