"""OpenGL is started once a process, or one line says why it was not."""

import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig, toed_in_rig
from stereo_occ.pictures import LOOK
from stereo_occ.render import gl
from stereo_occ.render.stereo import StereoRenderer

START = """
from stereo_occ.errors import UserError
from stereo_occ.render.gl import process_renderer
try:
    process_renderer(8, 8)
except UserError as error:
    print(error)
"""


def start_error(**environment):
    """What a fresh process says when it starts OpenGL under these variables."""
    clean = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    done = subprocess.run(
        [sys.executable, "-c", START], env=clean | environment, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.mark.parametrize(
    "environment",
    [
        {"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"},  # as without libegl-mesa0
        {"LIBGL_DRIVERS_PATH": "/nonexistent"},  # as without libgl1-mesa-dri
        {"EGL_DEVICE_ID": "99"},
    ],
)
def test_missing_opengl_is_one_line_with_the_packages(egl, environment):
    message = start_error(**environment)
    assert "libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri" in message
    assert len(message.splitlines()) == 1


def test_failed_import_is_one_line_with_the_packages(monkeypatch):
    monkeypatch.setattr(gl, "_renderer", None)
    monkeypatch.setitem(sys.modules, "pyrender", None)
    with pytest.raises(UserError, match=r"libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri$") as caught:
        gl.process_renderer(8, 8)
    assert "\n" not in str(caught.value)


def test_other_platforms_are_refused(monkeypatch):
    monkeypatch.setenv("PYOPENGL_PLATFORM", "osmesa")
    with pytest.raises(UserError, match=r"PYOPENGL_PLATFORM=osmesa: rendering needs egl"):
        gl.import_pyrender()


@pytest.mark.parametrize(("python", "installed", "works"), [
    ((3, 11, 0), "3.1.0", True),
    ((3, 12, 0), "3.1.0", False),
    ((3, 12, 0), "3.1.9", False),
    ((3, 13, 0), "3.1.10", True),
])  # fmt: skip
def test_old_pyopengl_is_refused_where_it_breaks(monkeypatch, egl, python, installed, works):
    monkeypatch.setattr(gl.sys, "version_info", python)
    monkeypatch.setattr(gl, "version", lambda _: installed)
    if works:
        gl.import_pyrender()
    else:
        with pytest.raises(UserError, match=rf"PyOpenGL {installed} .*PyOpenGL>=3.1.10"):
            gl.import_pyrender()


def test_forked_processes_are_refused(monkeypatch, egl):
    monkeypatch.setattr(gl, "_owner", os.getpid() + 1)
    with pytest.raises(UserError, match="spawn"):
        gl.process_renderer(8, 8)


def test_memory_of_former_objects_is_freed(egl):
    from OpenGL.GL import glDeleteBuffers, glGenBuffers, glIsBuffer

    rig, alive = toed_in_rig(1.0, 0.2, 1.0, 8), []
    with StereoRenderer() as renderer:
        for size in np.linspace(0.2, 0.4, 10):
            renderer.load(trimesh.creation.box([size] * 3))
            renderer.render(rig, np.eye(4), LOOK)
            newest = glGenBuffers(1)
            glDeleteBuffers(1, [newest])
            alive.append(sum(glIsBuffer(name) for name in range(1, newest)))
    assert len(set(alive)) == 1


def test_renderers_of_one_process_do_not_disturb_each_other(egl):
    rig = toed_in_rig(1.0, 0.2, 1.0, 32)
    first, second = StereoRenderer(), StereoRenderer()
    first.load(trimesh.creation.box([0.3] * 3))
    alone = first.render(rig, np.eye(4), LOOK)
    second.load(trimesh.creation.icosphere(radius=0.3))
    second.render(toed_in_rig(1.0, 0.2, 1.0, 48), np.eye(4), LOOK)
    second.close()
    np.testing.assert_array_equal(first.render(rig, np.eye(4), LOOK).rgb_2HW3, alone.rgb_2HW3)


def test_what_cannot_be_rendered_is_refused_by_name(egl):
    rig = toed_in_rig(1.0, 0.2, 1.0, 16)
    skewed = rig.right.K.copy()
    skewed[0, 1] = 0.5
    with StereoRenderer() as renderer:
        with pytest.raises(RuntimeError, match="load an object"):
            renderer.render(rig, np.eye(4), LOOK)
        renderer.load(trimesh.creation.box([0.3] * 3))
        with pytest.raises(UserError, match=r"one size, left is \(16, 16\) and right \(8, 16\)"):
            renderer.render(
                StereoRig(rig.left, Camera(rig.right.K, rig.right.camera_from_rig, 8, 16)), np.eye(4), LOOK
            )
        with pytest.raises(UserError, match=r"rig\.right\.K: skew"):
            renderer.render(
                StereoRig(rig.left, Camera(skewed, rig.right.camera_from_rig, 16, 16)), np.eye(4), LOOK
            )
        with pytest.raises(UserError, match="must not mirror"):
            renderer.render(rig, np.diag([1.0, 1.0, -1.0, 1.0]), LOOK)
