"""What is around the object: a table, things on it, a wall behind, all in 3D, so that their parallax is right.

Lengths are in diagonals of the object, so the same ranges serve every rig. Nothing cuts into the object, and nothing
hides more of it than is allowed.
"""

from colorsys import hsv_to_rgb
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from omegaconf import MISSING

from stereo_occ.geometry.camera import StereoRig
from stereo_occ.geometry.pose import Pose
from stereo_occ.ranges import bounds, draw, draw_log, share
from stereo_occ.render.finish import Finish, Pattern
from stereo_occ.render.pictured import draw_pictured
from stereo_occ.render.primitives import Solid, ball, box, cylinder, plane

#: Things on the table; the shader's 16, less the object, the table and the wall.
MAX_ON_TABLE = 12

#: How many of the things shade the table where they stand; the object always does.
SHADES = 5

#: Sides of the table and the wall, diagonals of the object.
EXTENT = 150.0

#: Places tried for each thing.
CANDIDATES = 12

#: Tells the shader that things shade a surface where they stand.
SHADED = np.array([0.0, 0.0, 0.0, -1.0])

SOLIDS = (box, cylinder, ball)
PATTERNS = (Pattern.stripes, Pattern.checks, Pattern.clouds, Pattern.clouds, Pattern.marble, Pattern.spots)


@dataclass
class ClutterConfig:
    """A table with things on it and a wall behind."""

    things: list[int] = MISSING  # how many; both ends included
    size: list[float] = MISSING  # longest side of a thing, log-uniform
    gap: list[float] = MISSING  # between a thing and the object, log-uniform
    wall: list[float] = MISSING  # from the object to the wall behind it, log-uniform
    elevation_deg: list[float] = MISSING  # of the cameras above the table, where the placement does not say
    patterned: float = MISSING  # share of surfaces with a pattern
    period: list[float] = MISSING  # of a pattern, log-uniform
    roughness: list[float] = MISSING  # 0 to 1
    occlusion: float = MISSING  # share of the object's width that a nearer thing may hide
    photographs: float | None = None  # share of tables and walls that show one of scikit-image's


@dataclass(frozen=True, eq=False)
class Clutter:
    """Everything but the object, rig frame.

    Attributes:
        vertices_V15, faces_F3: as :class:`~stereo_occ.render.surfaces.SurfaceDrawing` takes them.
        finishes: of things 1, 2, ...: the table, the wall, and what is on the table.
        contacts_C4: where the object and the things touch the table, and how far their shade reaches.
        up_3: unit vector.
    """

    vertices_V15: NDArray[np.float32]
    faces_F3: NDArray[np.int64]
    finishes: list[Finish]
    contacts_C4: NDArray[np.float64]
    up_3: NDArray[np.float64]


def draw_clutter(
    config: ClutterConfig,
    rig: StereoRig,
    pose: Pose,
    hull_N3: NDArray[np.float64],
    up_3: NDArray[np.float64] | None,
    rng: np.random.Generator,
) -> Clutter:
    """Surroundings of an object at ``pose``.

    Args:
        rig: the cameras, which must be above the table.
        hull_N3: points of the object frame whose convex hull is the object's.
        up_3: upwards in the rig frame; None draws it.

    Raises:
        UserError: for a range out of its limits.
    """
    fewest, most = bounds(config.things, "background.clutter.things", 0, MAX_ON_TABLE)
    count = int(rng.integers(int(fewest), int(most), endpoint=True))
    elevation = np.radians(draw(config.elevation_deg, "background.clutter.elevation_deg", rng, 0, 90))
    if up_3 is None:
        up_3 = np.array([0.0, np.cos(elevation), np.sin(elevation)])
    level = _Level(pose.to_rig(hull_N3), pose.scale, rig, up_3)
    pictured = share(config.photographs or 0, "background.clutter.photographs")
    surfaces = [
        draw_pictured(EXTENT, spare) if spare.random() < pictured else (plane(), None)
        for spare in rng.spawn(2)
    ]
    (table, _), (wall, _) = surfaces
    wall = _wall(config, wall, pose.scale, rng)
    placed = _on_table(config, level, count, rng)
    solids = [_placed(table, np.eye(3), np.full(3, EXTENT * pose.scale), np.zeros(3)), wall, *placed]
    finishes = [_finish(config, pose.scale, rng) for _ in solids]
    finishes[0] = replace(finishes[0], extra_4=SHADED)
    colors = [np.zeros((len(positions_V3), 4)) for positions_V3, _, _ in solids]
    for number, (_, colors_V4) in enumerate(surfaces):
        if colors_V4 is not None:
            colors[number] = colors_V4
            finishes[number] = replace(finishes[number], pattern=Pattern.own)
    parts, offset = [], 0
    for number, ((positions_V3, normals_V3, faces_F3), finish, colors_V4) in enumerate(
        zip(solids, finishes, colors, strict=True), start=1
    ):
        matrix = finish.texture_from_object
        texture_V3 = positions_V3 @ matrix[:3, :3].T + matrix[:3, 3]
        numbers_V1 = np.full((len(positions_V3), 1), number)
        to_rig = level.rig_from_level_33.T
        parts.append(
            (
                [
                    positions_V3 @ to_rig + level.origin_3,
                    normals_V3 @ to_rig,
                    colors_V4,
                    texture_V3,
                    numbers_V1,
                    np.ones((len(positions_V3), 1)),
                ],
                faces_F3 + offset,
            )
        )
        offset += len(positions_V3)
    vertices = np.concatenate([np.concatenate(columns, axis=1) for columns, _ in parts])
    contacts_C4 = np.array(
        [level.foot_4, *(_contact(positions_V3) for positions_V3, _, _ in placed[:SHADES])]
    )
    contacts_C4[:, :3] = contacts_C4[:, :3] @ level.rig_from_level_33.T + level.origin_3
    return Clutter(
        vertices.astype(np.float32),
        np.concatenate([faces for _, faces in parts]),
        finishes,
        contacts_C4,
        up_3,
    )


class _Level:
    """The table's frame: origin under the object's middle, +Y up, +Z towards the cameras; rig units."""

    def __init__(
        self, points_N3: NDArray[np.float64], diagonal: float, rig: StereoRig, up_3: NDArray[np.float64]
    ) -> None:
        middle_3 = (points_N3.min(axis=0) + points_N3.max(axis=0)) / 2
        centers_23 = np.stack([camera.center for camera in rig.cameras])
        z_3 = centers_23.mean(axis=0) - middle_3
        z_3 = z_3 - (z_3 @ up_3) * up_3
        if np.linalg.norm(z_3) < 1e-6:  # the cameras look straight down
            z_3 = np.cross(np.array([1.0, 0.0, 0.0]), up_3)
        z_3 /= np.linalg.norm(z_3)
        self.rig_from_level_33 = np.stack([np.cross(up_3, z_3), up_3, z_3], axis=1)
        self.diagonal = diagonal
        self.origin_3 = middle_3 + up_3 * ((points_N3 - middle_3) @ up_3).min()
        self.object_N3 = (points_N3 - self.origin_3) @ self.rig_from_level_33
        self.cameras_23 = (centers_23 - self.origin_3) @ self.rig_from_level_33

    @property
    def foot_4(self) -> NDArray[np.float64]:
        """Where the object touches the table, and how far its shade reaches."""
        low_M2 = self.object_N3[self.object_N3[:, 1] < 0.06 * self.diagonal][:, [0, 2]]
        middle_2 = (low_M2.min(axis=0) + low_M2.max(axis=0)) / 2
        reach = np.linalg.norm(low_M2 - middle_2, axis=1).max() + 0.15 * self.diagonal
        return np.array([middle_2[0], 0.0, middle_2[1], reach])


def _on_table(config: ClutterConfig, level: _Level, count: int, rng: np.random.Generator) -> list[Solid]:
    name = "background.clutter"
    object_2 = np.array(
        [np.ptp(level.object_N3[:, axis]) / 2 + level.object_N3[:, axis].min() for axis in (0, 2)]
    )
    around = np.linalg.norm(level.object_N3[:, [0, 2]] - object_2, axis=1).max()
    solids: list[Solid] = []
    taken: list[tuple[NDArray[np.float64], float]] = [(object_2, around)]
    for _ in range(count):
        solid = SOLIDS[int(rng.integers(len(SOLIDS)))]
        sides_3 = rng.uniform(0.3, 1, 3)
        if solid is not box:
            sides_3[2] = sides_3[0]
        if solid is ball:
            sides_3[:] = 1
        sides_3 *= level.diagonal * draw_log(config.size, f"{name}.size", rng, 1e-3, 50) / sides_3.max()
        reach = float(np.linalg.norm(sides_3[[0, 2]]) if solid is box else sides_3[0]) / 2
        gap = level.diagonal * draw_log(config.gap, f"{name}.gap", rng, 1e-3, 50)
        turn_C = rng.uniform(0, 2 * np.pi, CANDIDATES)
        places_C2 = object_2 + (around + reach + gap) * np.stack([np.sin(turn_C), np.cos(turn_C)], axis=1)
        free_C = np.all(
            [np.linalg.norm(places_C2 - other_2, axis=1) > reach + far for other_2, far in taken], axis=0
        )
        free_C &= _visible(
            level, places_C2, reach, sides_3[1], object_2, share(config.occlusion, f"{name}.occlusion")
        )
        yaw = rng.uniform(0, 2 * np.pi)
        if free_C.any():
            place_2 = places_C2[np.argmax(free_C)]
            turn_33 = _about_y(yaw)
            solids.append(_placed(solid(), turn_33, sides_3, np.array([place_2[0], 0, place_2[1]])))
            taken.append((place_2, reach))
    return solids


def _visible(
    level: _Level,
    places_C2: NDArray[np.float64],
    reach: float,
    height: float,
    object_2: NDArray[np.float64],
    occlusion: float,
) -> NDArray[np.bool_]:
    """Where a thing within ``reach`` of its axis leaves the object in view.

    It does from behind: with the camera on the object's side of a vertical plane between both. Else the bounding balls
    must be apart in the image.
    """
    away_C2 = object_2 - places_C2
    away_C2 /= np.linalg.norm(away_C2, axis=1, keepdims=True)
    middle_C3 = np.insert(places_C2, 1, height / 2, axis=1)
    radius = float(np.hypot(reach, height / 2))
    object_3 = np.insert(object_2, 1, level.object_N3[:, 1].max() / 2)
    object_radius = np.linalg.norm(level.object_N3 - object_3, axis=1).max()
    visible_C = np.ones(len(places_C2), bool)
    for camera_3 in level.cameras_23:
        behind_C = ((camera_3[[0, 2]] - places_C2) * away_C2).sum(axis=1) > reach
        to_C3, to_3 = middle_C3 - camera_3, object_3 - camera_3
        far_C, far = np.linalg.norm(to_C3, axis=1), np.linalg.norm(to_3)
        apart_C = np.arccos(np.clip(to_C3 @ to_3 / far_C / far, -1, 1))
        width = np.arcsin(min(1.0, object_radius / far))
        sum_C = np.arcsin(np.minimum(1, radius / far_C)) + width
        outside_C = far_C > 1.2 * radius + 0.1 * level.diagonal
        visible_C &= outside_C & (behind_C | (apart_C > sum_C - 2 * occlusion * width))
    return visible_C


def _wall(config: ClutterConfig, surface: Solid, diagonal: float, rng: np.random.Generator) -> Solid:
    distance = diagonal * draw_log(config.wall, "background.clutter.wall", rng, 0.5, EXTENT / 4)
    upright_33 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # +Y to +Z
    turn_33 = _about_y(np.radians(rng.uniform(-40, 40))) @ upright_33
    return _placed(surface, turn_33, np.full(3, EXTENT * diagonal), np.array([0, 0, -distance]))


def _about_y(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _placed(
    solid: Solid, turn_33: NDArray[np.float64], sides_3: NDArray[np.float64], place_3: NDArray[np.float64]
) -> Solid:
    positions_V3, normals_V3, faces_F3 = solid
    return (positions_V3 * sides_3) @ turn_33.T + place_3, normals_V3 @ turn_33.T, faces_F3


def _contact(positions_V3: NDArray[np.float64]) -> NDArray[np.float64]:
    low_3, high_3 = positions_V3.min(axis=0), positions_V3.max(axis=0)
    middle_3 = (low_3 + high_3) / 2
    return np.array([middle_3[0], 0, middle_3[2], 0.75 * max(high_3[0] - low_3[0], high_3[2] - low_3[2])])


def _finish(config: ClutterConfig, diagonal: float, rng: np.random.Generator) -> Finish:
    name = "background.clutter"
    first, second = rng.random((2, 3)) * [1, 0.7, 0.85] + [0, 0, 0.04]
    likeness, level = rng.random(2)
    second = second + likeness * (first - second)
    patterned = rng.random() < share(config.patterned, f"{name}.patterned")
    pattern = PATTERNS[int(rng.integers(len(PATTERNS)))]
    period = diagonal * draw_log(config.period, f"{name}.period", rng, 1e-3, 50)
    stretch_3 = np.where(rng.random(3) < 0.25, 0.15, 1.0)  # grain
    turn_33 = _about_y(rng.uniform(0, 2 * np.pi))
    texture_from_level = np.eye(4)
    texture_from_level[:3, :3] = stretch_3[:, None] * turn_33 / period
    texture_from_level[:3, 3] = rng.uniform(0, 64, 3)
    roughness = draw(config.roughness, f"{name}.roughness", rng)
    return Finish(
        np.array(hsv_to_rgb(*first)),
        np.array(hsv_to_rgb(*second)),
        roughness=roughness,
        reflection=0.6,
        pattern=pattern if patterned else Pattern.plain,
        warp=0.4 * likeness,
        level=0.3 + 0.4 * level,
        texture_from_object=texture_from_level,
    )
