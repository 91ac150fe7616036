"""How a view looks: what of an appearance depends on the scene, and the pictures as the cameras take them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from stereo_occ.data.scene import Scene
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.pose import Pose
from stereo_occ.ranges import bounds
from stereo_occ.render.appearance import (
    Appearance,
    BackgroundConfig,
    LightsConfig,
    MaterialConfig,
    draw_appearance,
)
from stereo_occ.render.clutter import draw_clutter
from stereo_occ.render.sensor import LIMITS, SensorConfig
from stereo_occ.render.texture import TextureConfig, draw_finish


def dressed(
    appearance: Appearance,
    texture: TextureConfig,
    background: BackgroundConfig,
    scene: Scene,
    hull_N3: NDArray[np.float64],
    has_colors: bool,
    rngs: Sequence[np.random.Generator],
) -> Appearance:
    """The appearance with what the groups ``texture`` and ``background`` add, each from a generator of its own.

    Args:
        hull_N3: points of the object frame whose convex hull is the object's.
        has_colors: whether the object has colours of its own.
        rngs: for the texture and for the clutter.

    Raises:
        UserError: for ranges out of their limits.
    """
    if not texture.off:
        appearance = replace(appearance, finish=draw_finish(texture, appearance, has_colors, rngs[0]))
    if background.clutter is not None:
        clutter = draw_clutter(background.clutter, scene.true_rig, scene.pose, hull_N3, scene.up_3, rngs[1])
        appearance = replace(appearance, clutter=clutter)
    return appearance


def check_look(
    lights: LightsConfig,
    material: MaterialConfig,
    texture: TextureConfig,
    background: BackgroundConfig,
    sensor: SensorConfig,
) -> None:
    """Draw from every range of these groups once.

    Raises:
        UserError: for the first range that is out of its limits.
    """
    rng = np.random.default_rng(0)
    appearance = draw_appearance(lights, material, background, rng)
    rig = toed_in_rig(1.0, 0.2, 1.0, 8)
    scene = Scene(rig, rig, Pose(np.eye(3), 1.0, np.zeros(3)))
    corners_83 = np.array(list(product((-0.5, 0.5), repeat=3))) / 3**0.5
    dressed(appearance, texture, background, scene, corners_83, False, [rng, rng])
    for name, limits in LIMITS.items():
        bounds(getattr(sensor, name), f"sensor.{name}", *limits)
