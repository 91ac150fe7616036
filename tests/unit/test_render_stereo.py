"""Pixels, coverage and depth against analytic scenes."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import trimesh

from stereo_occ.geometry.camera import Camera, StereoRig, toed_in_rig
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.pictures import LOOK
from stereo_occ.render.appearance import GAMMA
from stereo_occ.render.stereo import StereoRenderer

SIDE, RADIUS = 64, 0.3
pytestmark = pytest.mark.usefixtures("egl")


@pytest.fixture(scope="module")
def renderer():
    return StereoRenderer()


@pytest.fixture(scope="module")
def ball():
    return trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)


def at(*center, scale=1.0):
    pose = np.diag([scale, scale, scale, 1.0])
    pose[:3, 3] = center
    return pose


def off_center_rig(seed):
    """Two upright cameras turned and cropped at random, the fixation point in view of both."""
    rng = np.random.default_rng(seed)
    rig = toed_in_rig(rng.uniform(0.8, 1.3), rng.uniform(0.05, 0.4), rng.uniform(0.9, 1.2), SIDE)
    turn = np.eye(4)
    turn[:3, :3] = random_rotations(1, rng)[0]
    cameras = []
    for camera in rig.cameras:
        K = camera.K.copy()
        K[:2, 2] += rng.uniform(-6, 6, 2)
        cameras.append(Camera(K, camera.camera_from_rig @ turn, SIDE, SIDE))
    return StereoRig(*cameras)


RIGS = [toed_in_rig(1.0, pi / 16, pi / 3, SIDE), *(off_center_rig(seed) for seed in range(3))]


def ball_coverage(camera, center, radius, samples=8):
    """Share of each pixel whose rays meet the ball, from a grid of ``samples`` by ``samples`` rays a pixel."""
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    steps = (np.arange(SIDE)[:, None] + offsets).ravel()
    u, v = np.meshgrid(steps, steps)
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.center
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    to_center = np.asarray(center) - camera.center
    along = rays @ to_center
    hit = to_center @ to_center - along**2 < radius**2
    return hit.reshape(SIDE, samples, SIDE, samples).mean(axis=(1, 3))


@pytest.mark.parametrize("rig", RIGS)
def test_coverage_is_that_of_an_analytic_ball(renderer, ball, rig):
    renderer.load(ball)
    mask_2HW = renderer.render(rig, at(0.05, -0.04, 0.08), LOOK).mask_2HW
    for mask_HW, camera in zip(mask_2HW, rig.cameras, strict=True):
        coverage_HW = ball_coverage(camera, (0.05, -0.04, 0.08), RADIUS)
        assert np.abs(mask_HW / 255 - coverage_HW).max() < 0.5  # four samples a pixel
        for axis_HW in np.indices(coverage_HW.shape):
            assert centroid(axis_HW, mask_HW) == pytest.approx(centroid(axis_HW, coverage_HW), abs=0.06)
        assert mask_HW.sum() / 255 == pytest.approx(coverage_HW.sum(), rel=0.01)


def centroid(axis_HW, weight_HW):
    return (axis_HW * weight_HW).sum() / weight_HW.sum()


@pytest.mark.parametrize("rig", RIGS)
def test_depth_lies_on_the_analytic_ball(renderer, ball, rig):
    renderer.load(ball)
    images = renderer.render(rig, at(-0.06, 0.02, -0.1), LOOK)
    for depth_HW, mask_HW, camera in zip(images.depth_2HW, images.mask_2HW, rig.cameras, strict=True):
        v, u = np.nonzero(mask_HW == 255)
        points = camera.unproject(np.stack([u, v], axis=1).astype(float), depth_HW[v, u].astype(float))
        error = np.linalg.norm(points - [-0.06, 0.02, -0.1], axis=1) - RADIUS
        assert np.median(np.abs(error)) < 5e-4
        assert np.abs(error).max() < 0.01
        assert (depth_HW[mask_HW == 0] == 0).all()
        assert (depth_HW[mask_HW > 0] > 0).all()


def test_pose_scales_and_moves(renderer, ball):
    renderer.load(ball)
    rig = RIGS[0]
    posed = renderer.render(rig, at(0.1, 0.1, -0.1, scale=0.5), LOOK)
    renderer.load(ball.copy().apply_transform(at(0.1, 0.1, -0.1, scale=0.5)))
    baked = renderer.render(rig, np.eye(4), LOOK)
    assert np.abs(posed.rgb_2HW3.astype(int) - baked.rgb_2HW3).max() <= 2
    assert np.abs(posed.depth_2HW - baked.depth_2HW).max() < 1e-4


def test_a_point_in_front_of_the_fixation_point_has_positive_disparity(renderer):
    renderer.load(trimesh.creation.icosphere(radius=0.05))
    for z, sign in ((0.2, 1), (-0.2, -1)):
        left_HW, right_HW = renderer.render(RIGS[0], at(0, 0, z), LOOK).mask_2HW.astype(float)
        _, columns_HW = np.indices(left_HW.shape)
        u_left, u_right = (centroid(columns_HW, mask_HW) for mask_HW in (left_HW, right_HW))
        assert np.sign(u_left - u_right) == sign
        assert abs(u_left - u_right) > 2


def test_background_is_exact_and_the_object_hides_it(renderer, ball):
    renderer.load(ball)
    images = renderer.render(RIGS[0], np.eye(4), LOOK)
    assert (images.rgb_2HW3[images.mask_2HW == 0] == LOOK.background_3).all()
    assert (images.rgb_2HW3[images.mask_2HW == 255].max(axis=-1) < 250).all()


def test_light_comes_from_where_it_is_said_to(renderer, ball):
    """The key light of LOOK is up on the left, so the upper left of the ball is brighter than the lower right."""
    renderer.load(ball)
    left_HW3 = renderer.render(RIGS[0], np.eye(4), LOOK).rgb_2HW3[0].astype(float)
    assert left_HW3[22:26, 22:26].mean() > left_HW3[38:42, 38:42].mean() + 20


def test_lights_of_the_former_appearance_are_off(renderer, ball):
    renderer.load(ball)
    dark = replace(LOOK, light_from_L3=np.zeros((0, 3)), light_color_L3=np.zeros((0, 3)))
    renderer.render(RIGS[0], np.eye(4), LOOK)
    images = renderer.render(RIGS[0], np.eye(4), dark)
    ambient_3 = np.rint(255 * (LOOK.ambient * LOOK.base_color_3) ** (1 / GAMMA))
    assert np.abs(images.rgb_2HW3[images.mask_2HW == 255] - ambient_3).max() <= 1


def test_inverted_winding_shades_the_same(renderer, ball):
    renderer.load(ball)
    right_way = renderer.render(RIGS[0], np.eye(4), LOOK).rgb_2HW3
    inverted = ball.copy()
    inverted.invert()
    renderer.load(inverted)
    assert np.abs(renderer.render(RIGS[0], np.eye(4), LOOK).rgb_2HW3.astype(int) - right_way).max() <= 2


def test_pixels_do_not_depend_on_what_was_drawn_before(renderer, ball):
    box = trimesh.creation.box((0.4, 0.3, 0.2))
    renderer.load(box)
    first = renderer.render(RIGS[1], at(0, 0.1, 0), LOOK)
    renderer.load(ball)
    renderer.render(toed_in_rig(1.0, 0.3, 1.0, 96), np.eye(4), LOOK)  # another object, rig and image size
    renderer.load(box)
    again = renderer.render(RIGS[1], at(0, 0.1, 0), LOOK)
    assert (first.rgb_2HW3 == again.rgb_2HW3).all()
    assert (first.mask_2HW == again.mask_2HW).all()
    assert (first.depth_2HW == again.depth_2HW).all()


def test_creases_stay_sharp(renderer):
    """Each visible face of a box under directional light has one colour."""
    renderer.load(trimesh.creation.box((0.5, 0.5, 0.5)))
    images = renderer.render(RIGS[0], np.eye(4), LOOK)
    center_HW3 = images.rgb_2HW3[0, 24:40, 24:40].astype(int)
    assert np.ptp(center_HW3, axis=(0, 1)).max() <= 6
