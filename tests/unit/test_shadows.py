"""What lights do not reach: shadows where geometry puts them, hollows as dark as their opening is small."""

from dataclasses import fields, replace
from math import pi

import numpy as np
import pytest
import trimesh
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.pose import Pose
from stereo_occ.pictures import LOOK
from stereo_occ.render.appearance import draw_appearance
from stereo_occ.render.clutter import draw_clutter
from stereo_occ.render.openness import openness
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape

RIG = toed_in_rig(1.0, pi / 16, pi / 3, 96)
RADIUS = 0.15
UP = np.array([0.0, np.cos(0.6), np.sin(0.6)])


@pytest.fixture(scope="module")
def renderer():
    return StereoRenderer()


def lit_from(light_3, **change):
    """One white light and little else."""
    light_3 = np.array(light_3) / np.linalg.norm(light_3)
    return replace(
        LOOK, light_from_L3=light_3[None], light_color_L3=np.full((1, 3), 2.0), ambient=0.1, **change
    )


def bare_table(mesh, scale):
    """A wide plain table under the object, which does not shade it by itself."""
    more = ["things=[0,0]", "wall=[30,30]", "patterned=0"]
    cfg = compose_config("render", ["background=clutter", *(f"background.clutter.{item}" for item in more)])
    pose = Pose(np.eye(3), scale, np.zeros(3))
    config = OmegaConf.to_object(cfg).background.clutter
    clutter = draw_clutter(config, RIG, pose, mesh.vertices, UP, np.random.default_rng(0))
    table = replace(clutter.finishes[0], color_3=np.full(3, 0.6), reflection=0.0, roughness=1.0)
    contacts_C4 = clutter.contacts_C4 * [1, 1, 1, 1e-3]
    return replace(clutter, contacts_C4=contacts_C4, finishes=[table, *clutter.finishes[1:]])


@pytest.mark.usefixtures("egl")
@pytest.mark.parametrize("aside_3", [(0, 0, 0), (0.8, 0, 0), (-0.5, 0, 0.4), (0.3, 0, -0.7)])
def test_a_ball_shades_the_table_where_its_rays_to_the_light_are_cut(renderer, aside_3):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5 / 3**0.5)
    scale = RADIUS / (0.5 / 3**0.5)
    renderer.load(ball)
    look = lit_from(UP + aside_3, clutter=bare_table(ball, scale))
    pose = np.diag([scale, scale, scale, 1.0])
    lit, shaded = (
        renderer.render(RIG, pose, replace(look, shadow=shadow)).rgb_2HW3[0].astype(int).sum(axis=-1)
        for shadow in (None, 0.0)
    )
    rows, columns = np.mgrid[20:96, 0:96]
    pixels_N2 = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(float)
    rays_N3 = RIG.left.unproject(pixels_N2, np.ones(len(pixels_N2))) - RIG.left.center
    reach_N1 = ((-RADIUS - RIG.left.center @ UP) / (rays_N3 @ UP))[:, None]
    table_N3 = RIG.left.center + reach_N1 * rays_N3
    closest_N3 = table_N3 - (table_N3 @ look.light_from_L3[0])[:, None] * look.light_from_L3[0]
    passing_N = np.linalg.norm(closest_N3, axis=1)  # of the ball's centre by the ray
    on_table_N = renderer.render(RIG, pose, look).mask_2HW[0, 20:].ravel() == 0
    near_N = on_table_N & (np.linalg.norm(table_N3, axis=1) < 0.4)
    ratio_N = shaded[20:].ravel() / lit[20:].ravel()
    dark_N, bright_N = near_N & (passing_N < 0.9 * RADIUS), near_N & (passing_N > 1.1 * RADIUS)
    assert dark_N.sum() > 30
    assert bright_N.sum() > 300
    assert ratio_N[dark_N].max() < 0.7
    assert ratio_N[bright_N].min() > 0.97


@pytest.mark.usefixtures("egl")
@pytest.mark.parametrize("edge", [0.0, 0.06])
def test_a_lit_convex_surface_does_not_shade_itself(renderer, edge):
    renderer.load(trimesh.creation.icosphere(subdivisions=4, radius=0.3))
    for light_3 in ([0.3, 0.4, 1.0], [1.0, 0.2, 0.1], [-0.2, 1.0, -0.4]):
        look = lit_from(light_3, reflection=1e-9)
        lit, shaded = (
            renderer.render(RIG, np.eye(4), replace(look, shadow=shadow)).rgb_2HW3.astype(int)
            for shadow in (None, edge)
        )
        difference = np.abs(lit - shaded).max(axis=-1)
        assert np.percentile(difference, 99) <= 3


@pytest.mark.usefixtures("egl")
def test_a_mug_is_darker_inside(renderer):
    mug = procedural_shape("mug", 0, 3).mesh
    renderer.load(mug)
    tilt = trimesh.transformations.rotation_matrix(0.9, [1, 0, 0])
    look = replace(LOOK, light_from_L3=np.zeros((0, 3)), light_color_L3=np.zeros((0, 3)), ambient=0.8)
    evenly, hollow = (
        renderer.render(RIG, tilt, replace(look, reflection=1e-9, shadow=shadow)).rgb_2HW3[0].astype(int)
        for shadow in (None, 0.0)
    )
    assert np.ptp(evenly[evenly.sum(axis=-1) < 700].max(axis=-1)) <= 60
    assert (evenly - hollow).min() >= 0
    assert (evenly - hollow).max() > 40


def test_openness_of_a_cup_is_what_its_opening_spans():
    """From the middle of the floor of a round cup: radius^2 / (radius^2 + depth^2) of evenly diffuse light."""
    for radius, depth in ((0.3, 0.3), (0.3, 0.6), (0.4, 0.1)):
        outer = trimesh.creation.cylinder(radius + 0.02, depth + 0.02, sections=96)
        inner = trimesh.creation.cylinder(radius, depth + 0.02, sections=96)
        inner.apply_translation([0, 0, 0.02])
        cup = trimesh.boolean.difference([outer, inner], engine="manifold")
        floor_13 = np.array([[0.0, 0.0, 0.02 - (depth + 0.02) / 2]])
        (share,) = openness(cup, floor_13, np.array([[0.0, 0.0, 1.0]]))
        assert share == pytest.approx(radius**2 / (radius**2 + depth**2), abs=0.03)


def test_openness_outside_of_a_ball_is_all_and_inside_nothing():
    ball = trimesh.creation.icosphere(subdivisions=4)
    np.testing.assert_array_equal(openness(ball, ball.vertices, ball.vertex_normals), 1)
    np.testing.assert_array_equal(openness(ball, ball.vertices, -ball.vertex_normals), 0)
    np.testing.assert_array_equal(openness(ball, ball.vertices, np.zeros_like(ball.vertices)), 1)


def test_shadows_change_nothing_else_that_is_drawn():
    def drawn(*overrides):
        cfg = OmegaConf.to_object(compose_config("render", ["lights=room", "material=glossy", *overrides]))
        return draw_appearance(cfg.lights, cfg.material, cfg.background, np.random.default_rng(3))

    room, without = drawn(), drawn("lights.shadows=null")
    assert without.shadow is None
    assert 0.005 <= room.shadow <= 0.06
    for item in fields(room):
        if item.name != "shadow":
            np.testing.assert_array_equal(getattr(room, item.name), getattr(without, item.name))
    with pytest.raises(UserError, match=r"lights.shadows.*0\.3"):
        drawn("lights.shadows=[0.1,0.3]")
