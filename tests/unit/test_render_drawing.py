"""The fast way of drawing gives the pixels of pyrender's own."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import trimesh

from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.pictures import LOOK
from stereo_occ.render.gl import import_pyrender, process_renderer
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape

pytestmark = pytest.mark.usefixtures("egl")

LOOKS = [LOOK, replace(LOOK, metallic=0.4, roughness=0.35, base_color_3=np.array([0.8, 0.1, 0.3]))]


@pytest.fixture(scope="module")
def mug():
    return procedural_shape("mug", 0, 1).mesh


def pose(seed, scale=1.0):
    matrix = np.eye(4)
    matrix[:3, :3] = scale * random_rotations(1, np.random.default_rng(seed))[0]
    return matrix


def pictures(mesh, side=48):
    rig = toed_in_rig(1.0, pi / 16, pi / 3, side)
    with StereoRenderer() as renderer:
        renderer.load(mesh)
        return [renderer.render(rig, pose(seed, 0.9), look) for seed in range(3) for look in LOOKS]


def assert_same(some, others):
    for one, other in zip(some, others, strict=True):
        for name, array in vars(one).items():
            np.testing.assert_array_equal(array, getattr(other, name))


def test_deferred_shading_gives_the_same_bits(mug, monkeypatch):
    deferred = process_renderer(8, 8)._renderer._deferred
    drawn = []
    draw = deferred.draw
    monkeypatch.setattr(deferred, "draw", lambda *arguments: (drawn.append(1), draw(*arguments)))
    fast = pictures(mug)
    assert len(drawn) == 2 * len(fast)
    monkeypatch.setattr(deferred, "can_draw", lambda mesh, flags: False)
    assert_same(fast, pictures(mug))
    assert len(drawn) == 2 * len(fast)


def test_vertex_colours_are_shaded_the_same_way(mug, monkeypatch):
    renderer = process_renderer(96, 96)
    pyrender = import_pyrender()
    rng = np.random.default_rng(0)
    primitive = pyrender.Primitive(
        mug.vertices,
        normals=mug.vertex_normals,
        indices=mug.faces,
        color_0=np.column_stack([rng.uniform(0.2, 1, (len(mug.vertices), 3)), np.ones(len(mug.vertices))]),
        material=pyrender.MetallicRoughnessMaterial(),
    )
    scene = pyrender.Scene(bg_color=[0, 0, 0, 0], ambient_light=[0.2, 0.2, 0.2])
    scene.add(pyrender.Mesh([primitive]), pose=pose(5))
    scene.add(pyrender.DirectionalLight(intensity=2.0), pose=pose(6))
    scene.add(
        pyrender.PerspectiveCamera(pi / 3), pose=trimesh.transformations.translation_matrix([0, 0, 1.2])
    )
    deferred = renderer._renderer._deferred
    monkeypatch.setattr(deferred, "can_draw", lambda mesh, flags: False)
    plain, depth = renderer.render(scene, pyrender.RenderFlags.RGBA)
    monkeypatch.undo()
    assert deferred.can_draw(
        next(iter(scene.meshes)), pyrender.RenderFlags.RGBA | pyrender.RenderFlags.OFFSCREEN
    )
    fast, fast_depth = renderer.render(scene, pyrender.RenderFlags.RGBA)
    assert plain[..., 3].any()
    np.testing.assert_array_equal(fast, plain)
    np.testing.assert_array_equal(fast_depth, depth)


def test_images_of_another_size_in_between_change_nothing(mug):
    first = pictures(mug)
    pictures(mug, side=20)
    assert_same(first, pictures(mug))


def test_what_the_object_does_not_cover_is_background(mug):
    (image, *_) = pictures(mug)
    background = image.mask_2HW == 0
    assert background.any()
    assert (image.depth_2HW[background] == 0).all()
    assert (image.rgb_2HW3[background] == LOOK.background_3).all()
