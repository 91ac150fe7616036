"""Textures, reflections and clutter: the same scene in both pictures, and pyrender's when all is off."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import trimesh
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.pictures import LOOK
from stereo_occ.render.appearance import GAMMA
from stereo_occ.render.clutter import draw_clutter
from stereo_occ.render.finish import Finish, Pattern, root_of_linear
from stereo_occ.render.pictured import PHOTOGRAPHS, photograph, pictured_plane
from stereo_occ.render.pictured import SIDE as SIDE_OF_PHOTOGRAPHS
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.render.texture import PATTERNS, TextureConfig, draw_finish, periodic, plain_finish
from stereo_occ.shapes.procedural import procedural_shape

SIDE = 64
RIG = toed_in_rig(1.0, pi / 16, pi / 3, SIDE)
pytestmark = pytest.mark.usefixtures("egl")

#: Light from everywhere: a surface looks the same from both cameras.
EVEN = replace(LOOK, light_from_L3=np.zeros((0, 3)), light_color_L3=np.zeros((0, 3)), ambient=1.0)


@pytest.fixture(scope="module")
def renderer():
    return StereoRenderer()


@pytest.fixture(scope="module")
def mug():
    return procedural_shape("mug", 0, 3).mesh


def poses(count=3, scale=0.7):
    rng = np.random.default_rng(0)
    return [Pose(turn, scale, np.zeros(3)) for turn in random_rotations(count, rng)]


def clutter_of(mesh, pose, *overrides, seed=0, up=None):
    cfg = OmegaConf.to_object(compose_config("render", ["background=clutter", *overrides]))
    hull = mesh.convex_hull.vertices
    return draw_clutter(cfg.background.clutter, RIG, pose, hull, up, np.random.default_rng(seed))


@pytest.mark.parametrize("change", [{}, {"metallic": 0.4, "roughness": 0.3}])
def test_plain_surfaces_agree_with_pyrender(renderer, mug, change):
    renderer.load(mug)
    look = replace(LOOK, **change)
    for pose in poses():
        plain = renderer.render(RIG, pose.rig_from_object, look)
        ours = renderer.render(RIG, pose.rig_from_object, replace(look, finish=plain_finish(look)))
        difference = np.abs(plain.rgb_2HW3.astype(int) - ours.rgb_2HW3)
        assert np.percentile(difference, 99.5) <= 2
        assert (plain.mask_2HW != ours.mask_2HW).mean() < 1e-3
        both = (plain.depth_2HW > 0) & (ours.depth_2HW > 0)
        assert np.percentile(np.abs(plain.depth_2HW - ours.depth_2HW)[both], 99.5) < 1e-3


def pattern_look(pattern, warp=0.3):
    finish = Finish(
        np.array([0.05, 0.1, 0.2]), np.array([0.8, 0.7, 0.5]), pattern=pattern, warp=warp,
        texture_from_object=periodic(np.eye(3) / 0.4, np.array([7.0, 9.0, 11.0])),
    )  # fmt: skip
    return replace(EVEN, finish=finish)


@pytest.mark.parametrize("pattern", [Pattern.stripes, Pattern.checks, Pattern.clouds, Pattern.spots])
def test_patterns_stick_to_the_surface_in_both_pictures(renderer, mug, pattern):
    """A pixel of the left picture and where the right camera sees its point have one colour."""
    renderer.load(mug)
    images = renderer.render(RIG, poses(1, 0.9)[0].rig_from_object, pattern_look(pattern))
    assert images.rgb_2HW3[0][images.mask_2HW[0] == 255].std(axis=0).min() > 8
    errors = []
    v, u = np.nonzero(images.mask_2HW[0] == 255)
    points_N3 = RIG.left.unproject(
        np.stack([u, v], axis=1).astype(float), images.depth_2HW[0, v, u].astype(float)
    )
    pixels_N2, depth_N = RIG.right.project(points_N3)
    for (x, y), depth, left_3 in zip(pixels_N2, depth_N, images.rgb_2HW3[0, v, u].astype(int), strict=True):
        i, j = round(y), round(x)
        seen = images.depth_2HW[1, i, j]
        if images.mask_2HW[1, i, j] == 255 and abs(seen - depth) < 0.01:
            errors.append(np.abs(images.rgb_2HW3[1, i, j] - left_3).max())
    assert len(errors) > 200
    assert np.median(errors) < 12


def test_own_colours_are_shown(renderer):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.4)
    color = np.array([200, 40, 90], np.uint8)
    renderer.load(ball, np.tile(color, (len(ball.vertices), 1)))
    look = replace(EVEN, finish=replace(plain_finish(EVEN), pattern=Pattern.own))
    images = renderer.render(RIG, np.eye(4), look)
    expected = 255 * (np.where(color > 10, ((color / 255 + 0.055) / 1.055) ** 2.4, 0)) ** (1 / GAMMA)
    assert np.abs(images.rgb_2HW3[images.mask_2HW == 255] - expected).max() <= 3


def test_clutter_hides_nothing_and_leaves_mask_and_depth_alone(renderer, mug):
    renderer.load(mug)
    for seed, pose in enumerate(poses(4)):
        alone = renderer.render(RIG, pose.rig_from_object, replace(LOOK, finish=plain_finish(LOOK)))
        clutter = clutter_of(mug, pose, "background.clutter.things=[12,12]", seed=seed)
        images = renderer.render(RIG, pose.rig_from_object, replace(LOOK, clutter=clutter))
        assert len(clutter.finishes) > 6
        assert (images.mask_2HW == alone.mask_2HW).mean() > 0.999
        assert (images.depth_2HW == alone.depth_2HW).mean() > 0.999
        inside = alone.mask_2HW == 255
        assert np.abs(images.rgb_2HW3.astype(int) - alone.rgb_2HW3)[inside].max() <= 2


def test_occlusion_hides_a_part_where_it_is_asked_for(renderer, mug):
    renderer.load(mug)
    shares = []
    for seed, pose in enumerate(poses(6)):
        more = ["background.clutter.things=[12,12]", "background.clutter.occlusion=0.5"]
        clutter = clutter_of(mug, pose, *more, seed=seed)
        images = renderer.render(RIG, pose.rig_from_object, replace(LOOK, clutter=clutter))
        alone = renderer.render(RIG, pose.rig_from_object, LOOK)
        shares.append(images.mask_2HW.sum() / alone.mask_2HW.sum())
    assert 0.3 < min(shares) < 0.98


def test_photographs_on_table_and_wall_change_colours_alone(renderer, mug):
    pose = poses(1)[0]
    plain, pictured = (clutter_of(mug, pose, f"background.clutter.photographs={share}") for share in (0, 1))
    renderer.load(mug)
    before, after = (
        renderer.render(RIG, pose.rig_from_object, replace(LOOK, clutter=clutter))
        for clutter in (plain, pictured)
    )
    np.testing.assert_array_equal(before.mask_2HW, after.mask_2HW)
    np.testing.assert_array_equal(before.depth_2HW, after.depth_2HW)
    moved_N = pictured.vertices_V15[pictured.vertices_V15[:, 13] > 2, :3]
    np.testing.assert_array_equal(moved_N, plain.vertices_V15[plain.vertices_V15[:, 13] > 2, :3])
    around = before.mask_2HW == 0
    assert (before.rgb_2HW3[around] != after.rgb_2HW3[around]).any(axis=1).mean() > 0.5


def test_a_pictured_plane_shows_the_photograph_upright():
    rgb_HW3 = np.random.default_rng(0).integers(256, size=(7, 7, 3), dtype=np.uint8)
    (positions_V3, normals_V3, faces_F3), colors_V4 = pictured_plane(rgb_HW3, 0.5)
    corners_F33 = positions_V3[faces_F3]
    sides_F3 = np.cross(corners_F33[:, 1] - corners_F33[:, 0], corners_F33[:, 2] - corners_F33[:, 0])
    assert (sides_F3[:, 1] > 0).all()
    assert sides_F3[:, 1].sum() / 2 == pytest.approx(1)
    np.testing.assert_array_equal(normals_V3, np.tile([0, 1, 0], (len(positions_V3), 1)))
    for place, pixel in (((-0.25, -0.25), (0, 0)), ((0.25, -0.25), (0, 6)), ((-0.25, 0.25), (6, 0))):
        (vertex,) = np.flatnonzero(np.isclose(positions_V3[:, [0, 2]], place).all(axis=1))
        np.testing.assert_allclose(colors_V4[vertex, :3], root_of_linear(rgb_HW3[pixel]))
    assert len(np.unique(colors_V4[np.abs(positions_V3).max(axis=1) > 0.26], axis=0)) == 1


def test_own_colours_are_roots_of_linear_ones():
    np.testing.assert_allclose(root_of_linear(np.array([0, 188, 255])) ** 2, [0, 0.503, 1], atol=1e-3)


@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_every_photograph_is_there(name):
    picture = photograph(name)
    assert picture.shape == (SIDE_OF_PHOTOGRAPHS, SIDE_OF_PHOTOGRAPHS, 3)
    assert picture.std() > 10


def test_the_table_has_the_right_parallax(renderer, mug):
    """Pixels of the table, by its known plane, have one colour in both pictures."""
    up = np.array([0.0, np.cos(0.6), np.sin(0.6)])
    renderer.load(mug)
    pose = poses(1)[0]
    more = [
        "background.clutter.things=[0,0]",
        "background.clutter.wall=[30,30]",
        "background.clutter.patterned=1",
    ]
    clutter = clutter_of(mug, pose, *more, "background.clutter.period=[0.8,0.8]", up=up)
    colors = {"color_3": np.zeros(3), "second_3": np.full(3, 0.9)}
    table = replace(clutter.finishes[0], pattern=Pattern.marble, warp=0.3, reflection=0, **colors)
    no_shade_C4 = clutter.contacts_C4 * [1, 1, 1, 0.01]
    clutter = replace(clutter, contacts_C4=no_shade_C4, finishes=[table, *clutter.finishes[1:]])
    images = renderer.render(RIG, pose.rig_from_object, replace(EVEN, clutter=clutter))
    height = (pose.to_rig(mug.convex_hull.vertices) @ up).min()
    rows, columns = np.mgrid[40:64, 0:64]
    pixels_N2 = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(float)
    rays_N3 = RIG.left.unproject(pixels_N2, np.ones(len(pixels_N2))) - RIG.left.center
    reach_N1 = ((height - RIG.left.center @ up) / (rays_N3 @ up))[:, None]
    there_N2, _ = RIG.right.project(RIG.left.center + reach_N1 * rays_N3)
    nearest_N2 = np.rint(there_N2).astype(int)
    inside_N = ((nearest_N2 >= 0) & (nearest_N2 < SIDE)).all(axis=1)
    left_N = images.rgb_2HW3[0, rows.ravel(), columns.ravel()].astype(int)
    right_N = images.rgb_2HW3[1, nearest_N2[:, 1].clip(0, 63), nearest_N2[:, 0].clip(0, 63)]
    empty_N = (images.mask_2HW[0, rows.ravel(), columns.ravel()] == 0) & (
        images.mask_2HW[1, nearest_N2[:, 1].clip(0, 63), nearest_N2[:, 0].clip(0, 63)] == 0
    )
    chosen_N = inside_N & empty_N
    assert chosen_N.sum() > 300
    assert left_N[chosen_N].std(axis=0).max() > 10
    assert np.median(np.abs(left_N - right_N)[chosen_N].max(axis=1)) <= 12


def test_things_stand_on_the_table_beside_the_object(mug):
    for seed, pose in enumerate(poses(5)):
        clutter = clutter_of(mug, pose, "background.clutter.things=[12,12]", seed=seed)
        floor = (pose.to_rig(mug.convex_hull.vertices) @ clutter.up_3).min()
        object_N3 = pose.to_rig(mug.vertices)
        for number in range(3, len(clutter.finishes) + 1):
            points_N3 = clutter.vertices_V15[clutter.vertices_V15[:, 13] == number, :3]
            assert (points_N3 @ clutter.up_3).min() == pytest.approx(floor, abs=1e-5)
            flat = np.eye(3) - np.outer(clutter.up_3, clutter.up_3)
            gaps = np.linalg.norm((points_N3 @ flat)[::5, None] - (object_N3 @ flat)[None, ::40], axis=-1)
            assert gaps.min() > 0


def test_a_glaze_mirrors_the_window(renderer, mug):
    renderer.load(mug)
    dark = replace(LOOK, base_color_3=np.full(3, 0.02), roughness=0.08)
    pose = poses(1)[0].rig_from_object
    matt, glazed = (renderer.render(RIG, pose, replace(dark, reflection=r, finish=None)) for r in (0.0, 1.0))
    inside = matt.mask_2HW == 255
    gain = glazed.rgb_2HW3.astype(int)[inside].max(axis=1) - matt.rgb_2HW3[inside].max(axis=1)
    assert gain.min() >= -2
    assert gain.max() > 60


@pytest.mark.parametrize(
    ("pattern", "cluttered"),
    [(Pattern.marble, True), (Pattern.spots, False), (Pattern.checks, False), (Pattern.marble, False)],
)
def test_pictures_do_not_depend_on_what_was_drawn_before(renderer, mug, pattern, cluttered):
    pose = poses(1)[0]
    look = replace(pattern_look(pattern), clutter=clutter_of(mug, pose) if cluttered else None)
    renderer.load(mug)
    first = renderer.render(RIG, pose.rig_from_object, look)
    renderer.load(procedural_shape("bottle", 0, 1).mesh)
    renderer.render(toed_in_rig(1.0, 0.3, 1.0, 48), np.eye(4), pattern_look(Pattern.spots))
    renderer.render(RIG, np.eye(4), LOOK)
    renderer.load(mug)
    for other in poses(4)[1:]:
        renderer.render(RIG, other.rig_from_object, pattern_look(pattern))
    again = renderer.render(RIG, pose.rig_from_object, look)
    np.testing.assert_array_equal(first.rgb_2HW3, again.rgb_2HW3)
    np.testing.assert_array_equal(first.depth_2HW, again.depth_2HW)


def texture(*overrides):
    return OmegaConf.to_object(compose_config("render", ["texture=procedural", *overrides])).texture


def test_meshes_keep_their_own_colours():
    own = texture()
    for seed in range(20):
        drawn = draw_finish(own, LOOK, True, np.random.default_rng(seed))
        assert drawn.pattern is Pattern.own


def test_every_pattern_is_drawn_at_its_share():
    half = texture("texture.share=0.5")
    drawn = [draw_finish(half, LOOK, False, np.random.default_rng(s)) for s in range(300)]
    patterned = [finish.pattern.name for finish in drawn if finish.pattern is not Pattern.plain]
    assert 0.4 < len(patterned) / 300 < 0.6
    assert set(patterned) == set(PATTERNS)


def test_unknown_patterns_are_refused():
    with pytest.raises(UserError, match=r"texture\.patterns: 'tartan' is none of stripes"):
        draw_finish(TextureConfig(patterns=["tartan"]), LOOK, False, np.random.default_rng(0))
