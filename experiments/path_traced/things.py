"""What stands and lies on a desk, before it has a place: each thing on y = 0, about the vertical axis, metres."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh, creation, util

from experiments.path_traced.real_objects import others
from experiments.path_traced.surfaces import Surface, anything, glaze, own_colors, printed
from stereo_occ.data.objects import ObjectSource
from stereo_occ.shapes.shape import Shape

#: Diagonal of the bounding box by category, metres.
DIAGONALS = {"mug": (0.10, 0.15), "bowl": (0.10, 0.22), "bottle": (0.18, 0.30)}

KINDS = ("box", "cylinder", "ball", "book", "vessel", "monitor", "keyboard")
WEIGHTS = (0.22, 0.18, 0.1, 0.12, 0.28, 0.05, 0.05)


@dataclass(frozen=True, eq=False)
class Thing:
    """A solid of one material.

    Attributes:
        mesh: own frame, metres.
        colors_V3: of its vertices, sRGB, where the surface asks for them.
        world_from_thing: 4x4 rigid.
    """

    mesh: Trimesh
    surface: Surface
    colors_V3: NDArray[np.uint8] | None = None
    world_from_thing: NDArray[np.float64] | None = None

    @property
    def world_V3(self) -> NDArray[np.float64]:
        """Its vertices in the world."""
        if self.world_from_thing is None:
            return np.asarray(self.mesh.vertices)
        return self.mesh.vertices @ self.world_from_thing[:3, :3].T + self.world_from_thing[:3, 3]


def draw_thing(kind: str, sources: Sequence[ObjectSource], number: int, rng: np.random.Generator) -> Thing:
    """A thing of one of :data:`KINDS`; vessels are real objects, but never the one with that number."""
    if kind == "vessel":
        return _vessel(others(sources, number, rng), rng)
    if kind == "monitor":
        # Dark and glossy, in front of who sits at the desk.
        panel = box(float(rng.uniform(0.35, 0.6)), float(rng.uniform(0.22, 0.35)), 0.02, lift=0.08)
        mesh = _joined([panel, box(0.05, 0.12, 0.03), box(0.2, 0.012, 0.14)])
        return Thing(
            mesh, Surface(np.full(3, rng.uniform(0.01, 0.04)), float(rng.uniform(0.06, 0.2)), coated=True)
        )
    if kind == "keyboard":
        keys = [
            box(0.016, 0.008, 0.016, lift=0.015).apply_translation(
                [0.021 * column - 0.147, 0, 0.021 * row - 0.042]
            )
            for column in range(15)
            for row in range(5)
        ]
        value = float(rng.choice([0.02, 0.6]))
        return Thing(_joined([box(0.33, 0.016, 0.12), *keys]), Surface(np.full(3, value), 0.4))
    if kind == "book":
        return Thing(box(0.21, float(rng.uniform(0.01, 0.04)), 0.15), printed(0.15, rng))
    if kind == "ball":
        radius = float(rng.uniform(0.02, 0.06))
        return Thing(creation.icosphere(4, radius).apply_translation([0, radius, 0]), anything(rng))
    if kind == "cylinder":
        radius, height = rng.uniform([0.02, 0.05], [0.05, 0.16])
        upright = creation.cylinder(radius, height, sections=64)
        upright.apply_transform([[1, 0, 0, 0], [0, 0, 1, height / 2], [0, -1, 0, 0], [0, 0, 0, 1]])
        return Thing(upright, anything(rng))
    return Thing(box(*rng.uniform([0.04, 0.03, 0.04], [0.18, 0.2, 0.14]).tolist()), anything(rng))


def box(width: float, height: float, depth: float, lift: float = 0.0) -> Trimesh:
    """A box whose bottom is ``lift`` above the plane."""
    mesh: Trimesh = creation.box([width, height, depth])
    mesh.apply_translation([0, height / 2 + lift, 0])
    return mesh


def _joined(parts: list[Trimesh]) -> Trimesh:
    mesh = util.concatenate(parts)
    assert isinstance(mesh, Trimesh)
    return mesh


def standing(shape: Shape, diagonal: float, turn: float) -> NDArray[np.float64]:
    """4x4 similarity: the object of that diagonal, metres, on the plane, turned by so many radians."""
    c, s = diagonal * np.cos(turn), diagonal * np.sin(turn)
    lift = -diagonal * float(shape.mesh.bounds[0, 1])
    return np.array([[c, 0, s, 0], [0, diagonal, 0, lift], [-s, 0, c, 0], [0, 0, 0, 1]])


def _vessel(shape: Shape, rng: np.random.Generator) -> Thing:
    pose = standing(shape, float(rng.uniform(*DIAGONALS[shape.category])), 0.0)
    surface = glaze(rng.random() < 0.5, rng) if shape.colors is None else own_colors(rng)
    return Thing(shape.mesh.copy().apply_transform(pose), surface, shape.colors)
