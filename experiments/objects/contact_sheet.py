"""Draw ``contact_sheet.png``: the first twenty mugs, bowls and bottles of seed 0, seen from slightly above."""

from math import pi
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.pictures import picture
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import CATEGORIES

ROWS, COLUMNS = 2, 10  # per category


def main() -> None:
    rig = toed_in_rig(distance=1.0, half_angle=pi / 16, fov=pi / 3, side=64)
    rows = []
    for category in CATEGORIES:
        for row in range(ROWS):
            panels = []
            for index in range(row * COLUMNS, (row + 1) * COLUMNS):
                turn = Rotation.from_euler("yx", [37 * index, 30], degrees=True).as_matrix()
                pose = np.eye(4)
                pose[:3, :3] = turn
                panels.append(picture(procedural_shape(category, 0, index).mesh.apply_transform(pose), rig))
            rows.append(np.concatenate(panels, axis=1))
    Image.fromarray(np.concatenate(rows)).save(Path(__file__).parent / "contact_sheet.png", optimize=True)


if __name__ == "__main__":
    main()
