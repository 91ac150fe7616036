"""Renders the example pair: ``python examples/make_pair.py``."""

from pathlib import Path

import numpy as np
import yaml
from PIL import Image
from scipy.spatial.transform import Rotation

from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.geometry.pose import Pose
from stereo_occ.pictures import LOOK
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape

FOLDER = Path(__file__).parent

WIDTH, HEIGHT, FOCAL, BASELINE = 960, 540, 700.0, 0.08  # pixels, pixels, pixels, metres

#: An object that no split of the shipped configuration contains.
SEED, INDEX = 99, 3


def main() -> None:
    """A mug 16 cm large, 50 cm away, seen from above by a parallel pair."""
    K = np.array([[FOCAL, 0, (WIDTH - 1) / 2], [0, FOCAL, (HEIGHT - 1) / 2], [0, 0, 1]])
    poses = [
        np.diag([1.0, -1, -1, 1]) for _ in range(2)
    ]  # +Y up, +Z backwards, so that light falls from above
    poses[1][0, 3] = -BASELINE
    rig = StereoRig(*(Camera(K, pose, WIDTH, HEIGHT) for pose in poses))
    rotation = Rotation.from_euler("XY", [30, -35], degrees=True)
    pose = Pose(rotation.as_matrix(), 0.16, np.array([0.05, -0.02, -0.5]))
    with StereoRenderer() as renderer:
        renderer.load(procedural_shape("mug", SEED, INDEX).mesh)
        images = renderer.render(rig, pose.rig_from_object, LOOK)
    for name, image in zip(("left", "right"), images.rgb_2HW3, strict=True):
        Image.fromarray(image).save(FOLDER / f"{name}.png", optimize=True)
    calibration = {
        "image_width": WIDTH, "image_height": HEIGHT, "K1": K.tolist(), "D1": [0.0] * 5, "K2": K.tolist(),
        "D2": [0.0] * 5, "R": np.eye(3).tolist(), "T": [-BASELINE, 0.0, 0.0],
    }  # fmt: skip
    text = "# Names and signs as of cv2.stereoCalibrate; metres.\n" + yaml.safe_dump(
        calibration, default_flow_style=None, sort_keys=False
    )
    (FOLDER / "calibration.yaml").write_text(text)


if __name__ == "__main__":
    main()
