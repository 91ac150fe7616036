"""Things on the desk around the object that touch neither it nor each other and leave it in sight."""

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from experiments.path_traced.room import DESK
from experiments.path_traced.things import KINDS, WEIGHTS, Thing, draw_thing
from stereo_occ.data.objects import ObjectSource
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.geometry.crop import Box

NEAREST = 0.12  # of a thing to a camera along its axis, metres
GAP = 8  # pixels that a thing in front stays clear of the object's box

#: Kinds of things of which a desk has no two.
ONCE = ("monitor", "keyboard")

ATTEMPTS = 1000


def arranged(
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
