"""A real object on a desk among other things in a room, drawn from the numbers of the object and of the view.

World: the desk's top is y = 0, the object stands at the origin, +Y is up, +Z leads to who sits at the desk; metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin, tan

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from trimesh import Trimesh

from experiments.path_traced.real_objects import upright
from experiments.path_traced.surfaces import Surface, desk_top, glaze, own_colors, printed, wall_paint
from experiments.path_traced.things import DIAGONALS, KINDS, WEIGHTS, Thing, box, draw_thing, standing
from stereo_occ.data.objects import ObjectSource
from stereo_occ.data.placement import in_view
from stereo_occ.geometry.camera import Camera, StereoRig, transform_points
from stereo_occ.geometry.crop import Box
from stereo_occ.shapes.shape import Shape

WIDTH, HEIGHT = 960, 540  # pixels
BASELINE = 0.063  # metres
FOV_DEG = (85.0, 85.0, 85.0, 65.0)  # horizontal, each as likely
DISTANCE = (0.35, 0.7)  # metres
ELEVATION_DEG = (10.0, 55.0)  # of the cameras above the desk
DESK = (1.7, 0.85)  # width and depth, metres
FLOOR, CEILING = -0.74, 1.75  # metres
NEAREST = 0.12  # of a thing to a camera along its axis, metres
GAP = 8  # pixels that a thing in front stays clear of the object's box

#: The view in which every mug is dark and glossy and has most things around it.
DARK_MUGS = 1

#: Kinds of things of which a desk has no two.
ONCE = ("monitor", "keyboard")

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
    shape = upright(sources[number])
    diagonal = float(rngs[0].uniform(*DIAGONALS[shape.category]))
    pose = standing(shape, diagonal, float(rngs[0].uniform(0, 2 * pi)))
    hull_N3 = transform_points(np.asarray(shape.mesh.convex_hull.vertices), pose)
    rig = _cameras(diagonal, float(pose[1, 3]), rngs[1])
    look, surface = _look(shape, view, rngs[2])
    desk_3 = np.array([rngs[3].uniform(-0.35, 0.35), 0.0, rngs[3].uniform(-0.1, 0.15)])
    most = look == "dark mug"
    things = _around(sources, number, rig, hull_N3, desk_3, most, rngs[4])
    room, lights = _room(rig, desk_3, rngs[3])
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


def _around(
    sources: Sequence[ObjectSource],
    number: int,
    rig: StereoRig,
    hull_N3: NDArray[np.float64],
    desk_3: NDArray[np.float64],
    most: bool,
    rng: np.random.Generator,
) -> list[Thing]:
    """Things on the desk that touch neither the object nor each other, nor hide it."""
    count = 8 if most else int(rng.integers(3, 9))
    kinds = [*(("monitor", "keyboard") if most else ()), *rng.choice(KINDS, count, p=WEIGHTS)][:count]
    taken = [_footprint(hull_N3)]
    boxes = [Box.around(camera.project(hull_N3)[0]) for camera in rig.cameras]
    depths = [camera.project(hull_N3)[1].mean() for camera in rig.cameras]
    found: list[Thing] = []
    for place, kind in enumerate(kinds):
        if kind in ONCE and kind in kinds[:place]:
            continue
        thing = draw_thing(kind, sources, number, rng)
        for _ in range(ATTEMPTS):
            placed = replace(thing, world_from_thing=_place(kind, rng))
            print_N2 = _footprint(placed.world_V3)
            on_desk = (np.abs(print_N2 - desk_3[[0, 2]]) < np.array(DESK) / 2).all()
            if not on_desk or not all(_apart(print_N2, other_N2) for other_N2 in taken):
                continue
            views = zip(rig.cameras, boxes, depths, strict=True)
            if all(_clear(camera, box, depth, placed.world_V3) for camera, box, depth in views):
                taken.append(print_N2)
                found.append(placed)
                break
    return found


def _place(kind: str, rng: np.random.Generator) -> NDArray[np.float64]:
    """Close around the object; what belongs behind it is there and faces the cameras."""
    angle, radius = rng.uniform(0, 2 * pi), float(np.exp(rng.uniform(*np.log([0.06, 0.4]))))
    turn = rng.uniform(0, 2 * pi)
    if kind == "monitor":
        angle, radius, turn = rng.uniform(-0.7, 0.7) + pi, rng.uniform(0.15, 0.5), rng.uniform(-0.4, 0.4)
    place = np.eye(4)
    place[[0, 0, 2, 2], [0, 2, 0, 2]] = cos(turn), sin(turn), -sin(turn), cos(turn)
    place[[0, 2], 3] = radius * sin(angle), radius * cos(angle)
    return place


def _footprint(world_N3: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners ``(N, 2)`` of the convex outline on the desk, in order."""
    plan_N2 = world_N3[:, [0, 2]]
    return np.asarray(plan_N2[ConvexHull(plan_N2).vertices])


def _apart(a_N2: NDArray[np.float64], b_M2: NDArray[np.float64], gap: float = 0.004) -> bool:
    """Whether a line with ``gap`` metres on it divides two convex outlines."""
    for outline_K2 in (a_N2, b_M2):
        edges_K2 = np.roll(outline_K2, -1, axis=0) - outline_K2
        normals_K2 = edges_K2[:, ::-1] * [1, -1] / np.linalg.norm(edges_K2, axis=1, keepdims=True)
        along_KN, along_KM = normals_K2 @ a_N2.T, normals_K2 @ b_M2.T
        between_K = np.maximum(
            along_KM.min(axis=1) - along_KN.max(axis=1), along_KN.min(axis=1) - along_KM.max(axis=1)
        )
        if between_K.max() > gap:
            return True
    return False


def _clear(camera: Camera, box: Box, depth: float, points_N3: NDArray[np.float64]) -> bool:
    """Whether a thing is far enough from the camera, and not before what is in the box at that depth."""
    pixels_N2, depth_N = camera.project(points_N3)
    if depth_N.min() < NEAREST:
        return False
    if depth_N.min() > depth:
        return True
    (left, top), (right, bottom) = pixels_N2.min(axis=0) - GAP, pixels_N2.max(axis=0) + GAP
    return bool(left > box.right or right < box.left or top > box.bottom or bottom < box.top)


def _room(
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
