"""Render the pairs: path tracing, exposure, and the project's own model of two cameras.

    python -m experiments.path_traced.render --root DIR

DIR holds the real objects. A pair that is there is not rendered again; the same pair is the same each time.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from omegaconf import OmegaConf
from tqdm import tqdm

from experiments.path_traced.pairs import OUTPUT, folder_of, write_pair
from experiments.path_traced.real_objects import real_objects
from experiments.path_traced.scenes import draw_scene
from experiments.path_traced.tracing import traced
from stereo_occ.cli import compose_config
from stereo_occ.config import TrainConfig
from stereo_occ.pictures import LOOK
from stereo_occ.render.sensor import ENCODED, SensorConfig, photograph
from stereo_occ.render.stereo import StereoImages

#: Linear value of the 99th percentile of all that is no lamp and no window, before the cameras err in exposure.
NEAR_WHITE = 0.85


def exposed(light_2HW3: NDArray[np.float32], lamp_2HW: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Both pictures with one exposure, as display values."""
    white = np.percentile(light_2HW3[~lamp_2HW].mean(axis=-1), 99)
    steps = (light_2HW3 * (NEAR_WHITE / white)).clip(0, 1) * (len(ENCODED) - 1)
    return np.asarray(ENCODED[np.rint(steps).astype(np.uint16)])


def sensor() -> SensorConfig:
    """Two small cameras, which ``field`` was trained with."""
    config = OmegaConf.to_object(compose_config("train", ["sensor=noisy"]))
    assert isinstance(config, TrainConfig)
    return config.sensor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, required=True, help="folder of the real objects")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--views", type=int, default=2, help="of each object")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of objects")
    options = parser.parse_args()
    sources, cameras = real_objects(options.root), sensor()
    wanted = [
        (number, view)
        for view in range(options.views)
        for number in (options.only or range(len(sources)))
        if not folder_of(options.output, sources[number], view).exists()
    ]
    for number, view in tqdm(wanted):
        scene = draw_scene(sources, number, view)
        light_2HW3, mask_2HW, lamp_2HW = traced(scene, seed=1000 * view + number)
        pictures = StereoImages(
            exposed(light_2HW3, lamp_2HW),
            255 * mask_2HW.astype(np.uint8),
            np.zeros(mask_2HW.shape, np.float32),
        )
        rng = np.random.default_rng([number, view, 5])
        rgb_2HW3 = photograph(pictures, scene.rig, cameras, LOOK, False, rng)
        write_pair(
            folder_of(options.output, sources[number], view),
            rgb_2HW3,
            mask_2HW,
            scene.rig,
            scene.rig.left.camera_from_rig @ scene.world_from_object,
            scene.look,
        )


if __name__ == "__main__":
    main()
