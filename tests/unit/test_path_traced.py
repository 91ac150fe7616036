"""Path-traced pairs: the object is whole and in sight, things stand apart, files keep what they are given."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial import Delaunay
from trimesh import Trimesh, util

from experiments.path_traced import arrangement, room
from experiments.path_traced.cleaning import cleaned
from experiments.path_traced.pairs import folder_of, read_pairs, write_pair
from experiments.path_traced.scenes import BASELINE, DARK_MUGS, HEIGHT, WIDTH, draw_scene
from stereo_occ.data.objects import ObjectSource
from stereo_occ.geometry.camera import transform_points
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import CATEGORIES

SOURCES = [
    ObjectSource(category, f"{category}_{index}", partial(procedural_shape, category, 0, index))
    for category in CATEGORIES
    for index in range(2)
]
SQUARE_42 = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@pytest.fixture(scope="module", params=[(0, 0), (1, DARK_MUGS), (2, 0), (5, 1)], ids=str)
def drawn(request):
    number, view = request.param
    scene = draw_scene(SOURCES, number, view)
    mesh = scene.shape.mesh.copy().apply_transform(scene.world_from_object)
    return scene, mesh


def test_the_object_stands_on_the_desk_whole_in_both_images(drawn):
    scene, mesh = drawn
    assert mesh.bounds[0, 1] == pytest.approx(0, abs=1e-9)
    for camera in scene.rig.cameras:
        pixels_N2, depth_N = camera.project(mesh.vertices)
        assert depth_N.min() > 0.1
        assert (pixels_N2 >= 0).all()
        assert (pixels_N2 <= [WIDTH - 1, HEIGHT - 1]).all()
    left_3, right_3 = (camera.center for camera in scene.rig.cameras)
    assert np.linalg.norm(right_3 - left_3) == pytest.approx(BASELINE)


def test_nothing_hides_the_object(drawn):
    scene, mesh = drawn
    around = util.concatenate([Trimesh(thing.world_V3, thing.mesh.faces) for thing in scene.things])
    points_N3 = mesh.sample(500, seed=0)
    for camera in scene.rig.cameras:
        sight_N3 = points_N3 - camera.center
        starts_N3 = np.tile(camera.center, (len(points_N3), 1))
        hits_K3, rays_K, _ = around.ray.intersects_location(starts_N3, sight_N3, multiple_hits=False)
        share_K = np.linalg.norm(hits_K3 - camera.center, axis=1) / np.linalg.norm(sight_N3, axis=1)[rays_K]
        assert len(share_K) > 400  # a wall or the desk is behind the object
        assert share_K.min() > 0.98  # the object touches the desk


def test_things_stand_apart(drawn):
    scene, mesh = drawn
    standing = [mesh.vertices, *(t.world_V3 for t in scene.things if t.world_from_thing is not None)]
    assert len(standing) > 2
    for index, a_N3 in enumerate(standing):
        hull = Delaunay(a_N3[:, [0, 2]])
        for b_M3 in standing[index + 1 :]:
            assert (hull.find_simplex(b_M3[:, [0, 2]]) < 0).all()


@pytest.mark.parametrize(
    ("shift", "apart"),
    [((1.1, 0.0), True), ((0.0, -1.1), True), ((1.003, 0.0), False), ((0.5, 0.5), False)],
)
def test_outlines_are_apart_from_the_gap_on(shift, apart):
    assert arrangement._apart(SQUARE_42, SQUARE_42 + shift) is apart


def test_a_diamond_in_a_corner_is_apart_though_boxes_overlap():
    diamond_42 = np.array([[1.9, 1.0], [1.0, 1.9], [1.9, 2.8], [2.8, 1.9]])
    assert arrangement._apart(SQUARE_42, diamond_42 - [0.2, 0.2])
    assert not arrangement._apart(SQUARE_42, diamond_42 - [0.5, 0.5])


def test_each_mug_is_dark_and_glossy_once():
    looks = [draw_scene(SOURCES, number, view).look for number in (0, 1) for view in (0, DARK_MUGS)]
    assert [look == "dark mug" for look in looks] == [False, True, False, True]


@pytest.mark.parametrize("half", [0.1, 0.5])
@pytest.mark.parametrize("height", [1.0, 2.0])
def test_a_lamp_gives_its_strength_however_large_and_far(half, height):
    frame = room._frame([0.0, height, 0.0], [half, 0, 0], [0, 0, half])
    light = room._light(frame, np.ones(3), 4 * half**2, 0.7)
    assert light.radiance_3 * 4 * half**2 / height**2 == pytest.approx(np.full(3, 0.7))
    assert frame[:3, 2] == pytest.approx([0, -1, 0])  # down


def test_walls_face_inwards(drawn):
    scene, _ = drawn
    sheets = [thing.mesh for thing in scene.things if len(thing.mesh.faces) == 2]
    assert len(sheets) >= 6
    for sheet in sheets:
        to_object_3 = -sheet.vertices.mean(axis=0)
        assert (sheet.face_normals @ to_object_3 > 0).all()


def test_cleaning_removes_noise_and_keeps_albedo_and_edges():
    rng = np.random.default_rng(0)
    albedo_HW3 = np.where(np.arange(40)[None, :, None] < 20, 0.2, 0.8) * np.ones((30, 40, 3))
    normal_HW3, depth_HW = np.zeros((30, 40, 3)), np.ones((30, 40))
    truth_HW3 = 0.6 * (albedo_HW3 + 0.01)
    noisy_HW3 = truth_HW3 * rng.uniform(0.5, 1.5, (30, 40, 1))
    parts = (part.astype(np.float32) for part in (noisy_HW3, albedo_HW3, normal_HW3, depth_HW))
    clean_HW3 = cleaned(*parts)
    before, after = (np.abs(image / truth_HW3 - 1).mean() for image in (noisy_HW3, clean_HW3))
    assert after < before / 4
    assert clean_HW3[:, 19].mean() < 0.3 * clean_HW3[:, 20].mean()


def test_a_pair_is_read_as_it_was_written(tmp_path):
    scene = draw_scene(SOURCES, 0, 0)
    rng = np.random.default_rng(0)
    rgb_2HW3 = rng.integers(0, 256, (2, HEIGHT, WIDTH, 3), np.uint8)
    mask_2HW = rng.random((2, HEIGHT, WIDTH)) < 0.5
    left_from_object = scene.rig.left.camera_from_rig @ scene.world_from_object
    folder = folder_of(tmp_path, SOURCES[0], 0)
    write_pair(folder, rgb_2HW3, mask_2HW, scene.rig, left_from_object, scene.look)
    (pair,) = read_pairs(tmp_path, SOURCES, range(2))
    assert (pair.source.key, pair.view, pair.look) == (SOURCES[0].key, 0, scene.look)
    assert np.array_equal(pair.photographs.rgb_2HW3, rgb_2HW3)
    assert np.array_equal(pair.photographs.mask_2HW, mask_2HW)
    vertices_V3 = np.asarray(scene.shape.mesh.vertices)
    world_V3 = transform_points(vertices_V3, scene.world_from_object)
    left_V3 = transform_points(vertices_V3, pair.photographs.left_from_object)
    read = pair.photographs.pair
    for drawn_camera, camera in zip(scene.rig.cameras, (read.left, read.right), strict=True):
        assert camera.size == (WIDTH, HEIGHT)
        assert camera.pixels(left_V3) == pytest.approx(drawn_camera.project(world_V3)[0], abs=1e-6)
