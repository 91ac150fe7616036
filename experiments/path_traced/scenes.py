"""A real object on a desk among other things in a room, drawn from the numbers of the object and of the view.

World: the desk's top is y = 0, the object stands at the origin, +Y is up, +Z leads to who sits at the desk; metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, radians, sin, tan

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from experiments.path_traced.arrangement import arranged
from experiments.path_traced.real_objects import own
from experiments.path_traced.room import Light, draw_room
from experiments.path_traced.surfaces import Surface, glaze, own_colors
from experiments.path_traced.things import DIAGONALS, Thing, standing
from stereo_occ.data.objects import ObjectSource
from stereo_occ.data.placement import in_view
from stereo_occ.geometry.camera import Camera, StereoRig, transform_points
from stereo_occ.shapes.shape import Shape

WIDTH, HEIGHT = 960, 540  # pixels
BASELINE = 0.063  # metres
FOV_DEG = (85.0, 85.0, 85.0, 65.0)  # horizontal, each as likely
DISTANCE = (0.35, 0.7)  # metres
ELEVATION_DEG = (10.0, 55.0)  # of the cameras above the desk

#: The view in which every mug is dark and glossy and has most things around it.
DARK_MUGS = 1

ATTEMPTS = 1000


@dataclass(frozen=True, eq=False)
class Scene:
    """What Mitsuba is given.

    Attributes:
        shape: the object, in its own frame.
        world_from_object: 4x4 similarity.
        rig: its rig frame is the world.
        look: what the object is made of: own, dark, light, or dark mug.
    """

    shape: Shape
    surface: Surface
    world_from_object: NDArray[np.float64]
    rig: StereoRig
    things: list[Thing]
    lights: list[Light]
    look: str


def draw_scene(sources: Sequence[ObjectSource], number: int, view: int) -> Scene:
    """The scene of an object's view; every part of it is drawn from a generator of its own."""
    rngs = [np.random.default_rng([number, view, stream]) for stream in range(5)]
    shape = own(sources[number])
    diagonal = float(rngs[0].uniform(*DIAGONALS[shape.category]))
    pose = standing(shape, diagonal, float(rngs[0].uniform(0, 2 * pi)))
    hull_N3 = transform_points(np.asarray(shape.mesh.convex_hull.vertices), pose)
    rig = _cameras(diagonal, float(pose[1, 3]), rngs[1])
    look, surface = _look(shape, view, rngs[2])
    desk_3 = np.array([rngs[3].uniform(-0.35, 0.35), 0.0, rngs[3].uniform(-0.1, 0.15)])
    most = look == "dark mug"
    things = arranged(sources, number, rig, hull_N3, desk_3, most, rngs[4])
    room, lights = draw_room(rig, desk_3, rngs[3])
    return Scene(shape, surface, pose, rig, things + room, lights, look)


def _look(shape: Shape, view: int, rng: np.random.Generator) -> tuple[str, Surface]:
    if shape.category == "mug" and view == DARK_MUGS:
        return "dark mug", glaze(True, rng, roughness=(0.05, 0.15))
    if shape.colors is not None:
        return "own", own_colors(rng)
    dark = bool(rng.random() < 0.5)
    return "dark" if dark else "light", glaze(dark, rng)


def _cameras(diagonal: float, height: float, rng: np.random.Generator) -> StereoRig:
    """A parallel pair that sees the object whole, anywhere in its images."""
    target_3 = np.array([0.0, height, 0.0])
    for _ in range(ATTEMPTS):
        distance, elevation = rng.uniform(*DISTANCE), radians(rng.uniform(*ELEVATION_DEG))
        azimuth, fov = radians(rng.uniform(-50, 50)), radians(rng.choice(FOV_DEG))
        sight_3 = -np.array(
            [sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation)]
        )  # from the cameras to the object
        focal = WIDTH / 2 / tan(fov / 2)
        K = np.array([[focal, 0, (WIDTH - 1) / 2], [0, focal, (HEIGHT - 1) / 2], [0, 0, 1]])
        right_3 = np.cross(sight_3, [0.0, 1.0, 0.0])
        right_3 /= np.linalg.norm(right_3)
        sees_33 = np.stack([right_3, np.cross(sight_3, right_3), sight_3])  # camera from world, object ahead
        # Turned until the object is where the pixel is, and a little about the line of sight.
        ray_3 = np.linalg.solve(K, [*(rng.uniform(0.1, 0.9, 2) * [WIDTH, HEIGHT]), 1.0])
        turn, _ = Rotation.align_vectors(ray_3[None] / np.linalg.norm(ray_3), [[0.0, 0.0, 1.0]])
        roll = Rotation.from_euler("z", rng.uniform(-5, 5), degrees=True)
        camera_from_world_33 = (turn * roll).as_matrix() @ sees_33
        middle_3 = target_3 - distance * sight_3
        cameras = []
        for side in (-0.5, 0.5):
            center_3 = middle_3 + side * BASELINE * camera_from_world_33[0]
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = camera_from_world_33, -camera_from_world_33 @ center_3
            cameras.append(Camera(K, pose, WIDTH, HEIGHT))
        rig = StereoRig(*cameras)
        if in_view(rig, target_3, diagonal):
            return rig
    raise RuntimeError(f"no view of an object {diagonal:.2f} m large")
