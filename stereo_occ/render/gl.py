"""Headless OpenGL: one pyrender renderer per process, for life.

Deleting a pyrender renderer terminates the EGL display that all of a process's renderers share, and a GPU mesh
belongs to the renderer that first drew it. So there is one, it is resized rather than replaced, and it ends with the
process.
"""

import importlib
import logging
import os
import sys
from contextlib import suppress
from importlib.metadata import version
from typing import Any

import numpy as np

from stereo_occ.errors import UserError

PACKAGES = "libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri"

_renderer: Any = None
_owner: int | None = None


def import_pyrender() -> Any:
    """pyrender, set up for EGL.

    Raises:
        UserError: if PyOpenGL is too old for this Python, ``PYOPENGL_PLATFORM`` names another platform (OSMesa has no
            coverage), or OpenGL cannot be loaded.
    """
    installed = tuple(int(part) for part in version("PyOpenGL").split(".")[:3] if part.isdigit())
    if sys.version_info >= (3, 12) and installed < (3, 1, 10):
        raise UserError(
            f"PyOpenGL {version('PyOpenGL')} does not work on Python 3.12 and later: "
            "pip install --no-deps 'PyOpenGL>=3.1.10'"
        )
    platform = os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    if platform != "egl":
        raise UserError(f"PYOPENGL_PLATFORM={platform}: rendering needs egl; unset the variable")
    logging.getLogger("OpenGL").setLevel(logging.WARNING)
    if not hasattr(np, "infty"):  # NumPy 2 dropped the name, pyrender.Mesh.bounds uses it
        vars(np)["infty"] = np.inf
    with suppress(ImportError):  # its LLVM crashes when it is loaded after Mesa's, as torch would do later
        importlib.import_module("triton")
    try:
        return importlib.import_module("pyrender")
    except Exception as error:
        raise _no_gl(error) from error


def process_renderer(width: int, height: int) -> Any:
    """The process's ``pyrender.OffscreenRenderer``, its viewport set to ``width`` x ``height`` pixels.

    Raises:
        UserError: if OpenGL cannot be started, or this process was forked from one that had started it.
    """
    global _renderer, _owner
    if _renderer is None:
        pyrender = import_pyrender()
        try:
            offscreen = pyrender.OffscreenRenderer(width, height)
            drawing = importlib.import_module("stereo_occ.render.drawing")  # imports OpenGL
            offscreen._renderer = drawing.FastRenderer(width, height)
        except Exception as error:
            raise _no_gl(error) from error
        _renderer, _owner = offscreen, os.getpid()
    if _owner != os.getpid():
        raise UserError(
            "rendering in a process forked after OpenGL started would hang: use the 'spawn' start method"
        )
    _renderer.viewport_width, _renderer.viewport_height = width, height
    return _renderer


def _no_gl(error: Exception) -> UserError:
    cause = " ".join(str(error).split())[:80] or type(error).__name__
    device = os.environ.get("EGL_DEVICE_ID")
    if device is not None:
        cause += f"; EGL_DEVICE_ID={device}"
    return UserError(
        f"rendering needs OpenGL through EGL, which failed to start ({cause}): apt-get install {PACKAGES}"
    )
