"""The room: desk, walls, floor, ceiling, pictures on the wall, and what shines."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from experiments.path_traced.surfaces import Surface, desk_top, printed, wall_paint
from experiments.path_traced.things import Thing, box
from stereo_occ.geometry.camera import StereoRig, transform_points

DESK = (1.7, 0.85)  # width and depth, metres
FLOOR, CEILING = -0.74, 1.75  # metres

ATTEMPTS = 1000


@dataclass(frozen=True, eq=False)
class Light:
    """A rectangle that shines to one side, or a ball.

    Attributes:
        world_from_unit: 4x4, from the square [-1, 1]^2 (it shines along +Z) or from the ball of radius 1.
        radiance_3: linear.
        ball: whether it is one.
    """

    world_from_unit: NDArray[np.float64]
    radiance_3: NDArray[np.float64]
    ball: bool = False


def draw_room(
    rig: StereoRig, desk_3: NDArray[np.float64], rng: np.random.Generator
) -> tuple[list[Thing], list[Light]]:
    """Desk, walls, floor, ceiling; a window, a lamp at the ceiling and often one on the desk."""
    width, depth = DESK
    board = box(width, 0.03, depth, lift=-0.03).apply_translation(desk_3)
    left, right = desk_3[0] - rng.uniform(1.0, 2.2), desk_3[0] + rng.uniform(1.0, 2.2)
    back, front = desk_3[2] - depth / 2 - rng.uniform(0.02, 1.0), desk_3[2] + 3.0
    paint, ceiling = wall_paint(rng), Surface(np.full(3, 0.8), 1.0)
    x, y, z = (left + right) / 2, (FLOOR + CEILING) / 2, (back + front) / 2
    half_x, half_y, half_z = (right - left) / 2, (CEILING - FLOOR) / 2, (front - back) / 2
    things = [
        Thing(board, desk_top(rng)),
        Thing(_sheet([x, y, back], [half_x, 0, 0], [0, half_y, 0]), paint),
        Thing(_sheet([x, y, front], [-half_x, 0, 0], [0, half_y, 0]), paint),
        Thing(_sheet([left, y, z], [0, 0, -half_z], [0, half_y, 0]), paint),
        Thing(_sheet([right, y, z], [0, 0, half_z], [0, half_y, 0]), paint),
        Thing(_sheet([x, FLOOR, z], [half_x, 0, 0], [0, 0, -half_z]), wall_paint(rng)),
        Thing(_sheet([x, CEILING, z], [half_x, 0, 0], [0, 0, half_z]), ceiling),
    ]
    for _ in range(int(rng.integers(0, 4))):  # pictures on the wall
        half = float(rng.uniform(0.12, 0.4))
        middle = [float(rng.uniform(left + half, right - half)), float(rng.uniform(0.1, 0.9)), back + 0.004]
        things.append(Thing(_sheet(middle, [half, 0, 0], [0, half * 0.75, 0]), printed(2 * half, rng)))
    side = 1.0 if rng.random() < 0.5 else -1.0
    wall = right if side > 0 else left
    half_2 = rng.uniform([0.4, 0.4], [0.8, 0.6])
    window_3 = np.array([wall - side * 0.02, rng.uniform(0.6, 0.9), rng.uniform(-0.3, 0.9)])
    window = _frame(window_3, [0, 0, side * half_2[0]], [0, half_2[1], 0])
    sky_3 = np.array([0.85, 0.95, 1.1])
    lights = [_light(window, sky_3, 4 * half_2.prod(), float(rng.uniform(0.3, 1.5)))]
    for bar in ((0.03, 2 * half_2[1], 0.03), (0.03, 0.03, 2 * half_2[0])):  # the window's cross
        mesh = box(*bar).apply_translation(window_3 - [side * 0.03, bar[1] / 2, 0])
        things.append(Thing(mesh, ceiling))
    warm_3 = np.array([1.1, 0.97, 0.78])
    half = float(rng.uniform(0.12, 0.5))
    lamp_3 = [float(rng.uniform(left + 0.6, right - 0.6)), CEILING - 0.03, float(rng.uniform(-0.2, 1.5))]
    lamp = _frame(lamp_3, [half, 0, 0], [0, 0, half])
    lights.append(_light(lamp, warm_3, 4 * half**2, float(rng.uniform(0.2, 1.2))))
    if rng.random() < 0.5 and (ball := _ball(rig, rng)) is not None:
        radius = ball[0, 0]
        lights.append(_light(ball, warm_3, pi * radius**2, float(rng.uniform(0.2, 0.8)), ball=True))
    return things, lights


def _ball(rig: StereoRig, rng: np.random.Generator) -> NDArray[np.float64] | None:
    """A bulb above the desk that no camera sees; None if there is no place."""
    for _ in range(ATTEMPTS):
        angle = rng.uniform(0, 2 * pi)
        middle_3 = np.array([rng.uniform(0.35, 0.8) * sin(angle), rng.uniform(0.35, 0.8), 0.0])
        middle_3[2] = rng.uniform(0.35, 0.8) * cos(angle)
        radius = float(rng.uniform(0.03, 0.06))
        if all(camera.clearance(middle_3) < -2 * radius for camera in rig.cameras):
            place = np.diag([radius, radius, radius, 1.0])
            place[:3, 3] = middle_3
            return place
    return None


def _light(
    world_from_unit: NDArray[np.float64],
    color_3: NDArray[np.float64],
    area: float,
    strength: float,
    ball: bool = False,
) -> Light:
    """One that gives the object about as much light as ``strength`` says, however large and far it is."""
    squared = float((world_from_unit[:3, 3] ** 2).sum())
    return Light(world_from_unit, color_3 * strength * squared / area, ball)


def _frame(
    middle: Sequence[float] | NDArray[np.float64], u: list[float], v: list[float]
) -> NDArray[np.float64]:
    """4x4 from the square [-1, 1]^2: its middle and half its sides; it faces ``u x v``."""
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 3] = u, v, middle
    normal_3 = np.cross(u, v)
    frame[:3, 2] = normal_3 / np.linalg.norm(normal_3)
    return frame


def _sheet(middle: list[float], u: list[float], v: list[float]) -> Trimesh:
    """A rectangle that faces ``u x v``."""
    corners_43 = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Trimesh(transform_points(corners_43, _frame(middle, u, v)), [[0, 1, 2], [0, 2, 3]], process=False)
