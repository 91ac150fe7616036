"""The pictures of one object: scenes and appearances drawn from a configuration, and rendered."""

from dataclasses import replace
from enum import IntEnum

import numpy as np

from stereo_occ.config import PairsConfig
from stereo_occ.data.look import dressed
from stereo_occ.data.rigs import RectifiedRigConfig
from stereo_occ.data.scene import Scene, draw_scene
from stereo_occ.data.shard import Views
from stereo_occ.render.appearance import draw_appearance
from stereo_occ.render.sensor import photograph
from stereo_occ.render.stereo import StereoImages, StereoRenderer
from stereo_occ.shapes.shape import Shape


class Stream(IntEnum):
    """Independent random streams of one object: what is drawn from one does not change what another gives."""

    POINTS, VIEWS, SCENE, TEXTURE, CLUTTER, SENSOR, MASK = range(7)


def render_views(shape: Shape, pairs: PairsConfig, object_seed: list[int], renderer: StereoRenderer) -> Views:
    """All views of an object; each is a function of the configuration, ``object_seed`` and its number alone.

    Raises:
        UserError: for ranges out of their limits, or if OpenGL cannot be started.
    """
    renderer.load(shape.mesh, shape.colors)
    hull_N3 = shape.mesh.vertices
    if isinstance(pairs.rig, RectifiedRigConfig) or pairs.background.clutter is not None:
        hull_N3 = shape.mesh.convex_hull.vertices
    scenes: list[Scene] = []
    pictures: list[StereoImages] = []
    for view in range(pairs.data.views):

        def stream(number: Stream, view: int = view) -> np.random.Generator:
            return np.random.default_rng([*object_seed, number, view])

        rng = stream(Stream.VIEWS)
        scene = draw_scene(
            pairs.rig, pairs.placement, pairs.data.image_side, hull_N3, rng, stream(Stream.SCENE)
        )
        appearance = dressed(
            draw_appearance(pairs.lights, pairs.material, pairs.background, rng),
            pairs.texture,
            pairs.background,
            scene,
            hull_N3,
            shape.colors is not None,
            [stream(Stream.TEXTURE), stream(Stream.CLUTTER)],
        )
        images = renderer.render(scene.true_rig, scene.pose.rig_from_object, appearance)
        masked = bool(stream(Stream.MASK).random() < pairs.background.masked)
        rgb_2HW3 = photograph(images, scene.true_rig, pairs.sensor, appearance, masked, stream(Stream.SENSOR))
        pictures.append(replace(images, rgb_2HW3=rgb_2HW3))
        scenes.append(scene)
    unit_N = np.array([scene.unit for scene in scenes])
    return Views(
        rgb=np.stack([images.rgb_2HW3 for images in pictures]),
        mask=np.stack([images.mask_2HW for images in pictures]),
        depth=np.stack([images.depth_2HW.astype(np.float16) for images in pictures]),
        K=np.stack([[camera.K for camera in scene.rig.cameras] for scene in scenes]),
        camera_from_rig=np.stack([[camera.camera_from_rig for camera in s.rig.cameras] for s in scenes]),
        rig_from_object=np.stack([scene.pose.rig_from_object for scene in scenes]),
        unit=unit_N if (unit_N != 1).any() else None,
    )
