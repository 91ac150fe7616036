"""The same objects, poses and cameras as the project's own shader draws them: what to compare with.

    python -m experiments.path_traced.own_shader --root DIR

Lights, materials and what is around are drawn as for the training of ``field``; sizes and sensors are the same.
"""

import argparse
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf
from tqdm import tqdm

from experiments.path_traced.pairs import folder_of, write_pair
from experiments.path_traced.real_objects import real_objects
from experiments.path_traced.scenes import draw_scene
from stereo_occ.cli import compose_config
from stereo_occ.config import TrainConfig
from stereo_occ.data.look import dressed
from stereo_occ.data.scene import Scene
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.geometry.pose import Pose
from stereo_occ.render.appearance import draw_appearance
from stereo_occ.render.sensor import photograph
from stereo_occ.render.stereo import CV_FROM_GL, StereoRenderer

OUTPUT = Path("outputs/path_traced_own_shader")

#: The groups of the first training of ``field``, but for the objects' own colours.
LOOKS = ["lights=random", "material=glossy", "texture=own", "background=clutter", "sensor=noisy"]


def seen_from_left(rig: StereoRig, world_from_object: np.ndarray) -> Scene:
    """With the left camera's axes as the rig's (+Y up, +Z towards the cameras), as lights are drawn for."""
    rig_from_world = CV_FROM_GL @ rig.left.camera_from_rig
    left, right = (
        Camera(camera.K, camera.camera_from_rig @ np.linalg.inv(rig_from_world), camera.width, camera.height)
        for camera in rig.cameras
    )
    turned = StereoRig(left, right)
    return Scene(turned, turned, Pose.from_matrix(rig_from_world @ world_from_object), rig_from_world[:3, 1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, required=True, help="folder of the real objects")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--views", type=int, default=2, help="of each object")
    options = parser.parse_args()
    config = OmegaConf.to_object(compose_config("train", LOOKS))
    assert isinstance(config, TrainConfig)
    sources = real_objects(options.root)
    numbers = [(number, view) for view in range(options.views) for number in range(len(sources))]
    with StereoRenderer() as renderer:
        for number, view in tqdm(numbers):
            folder = folder_of(options.output, sources[number], view)
            if folder.exists():
                continue
            drawn = draw_scene(sources, number, view)
            scene = seen_from_left(drawn.rig, drawn.world_from_object)
            shape = drawn.shape
            renderer.load(shape.mesh, shape.colors)
            rngs = [np.random.default_rng([number, view, stream]) for stream in range(5, 9)]
            appearance = dressed(
                draw_appearance(config.lights, config.material, config.background, rngs[1]),
                config.texture,
                config.background,
                scene,
                shape.mesh.convex_hull.vertices,
                shape.colors is not None,
                rngs[2:],
            )
            images = renderer.render(scene.rig, scene.pose.rig_from_object, appearance)
            rgb_2HW3 = photograph(images, scene.rig, config.sensor, appearance, False, rngs[0])
            left_from_object = drawn.rig.left.camera_from_rig @ drawn.world_from_object
            write_pair(folder, rgb_2HW3, images.mask_2HW > 127, drawn.rig, left_from_object, drawn.look)


if __name__ == "__main__":
    main()
