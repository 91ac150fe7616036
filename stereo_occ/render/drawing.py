"""pyrender's renderer without what costs time and shows nothing here.

On a software rasteriser at 64 pixels a third of pyrender's time is bookkeeping, and most of the rest shades samples
that no triangle covers. The pixels stay the same to the bit.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_occ.render.deferred import DeferredShading
from stereo_occ.render.gl import import_pyrender

import_pyrender()

from OpenGL import GL  # noqa: E402 (the platform is chosen above)
from pyrender import RenderFlags  # noqa: E402
from pyrender.renderer import Renderer  # noqa: E402


class FastRenderer(Renderer):  # type: ignore[misc]
    """``pyrender.Renderer`` for :mod:`stereo_occ.render.stereo`.

    - One sample per pixel in place of four, which would take most of the time.
    - Shading is deferred where it can be: see :class:`DeferredShading`.
    - Pixels are read where they were drawn, not from a copy.
    - A uniform is sent when its value is new: of one object most stay the same from view to view.
    """

    def __init__(self, width: int, height: int) -> None:
        super().__init__(width, height)
        self._remembering: dict[Any, Uniforms] = {}
        self._light_limits: dict[int, list[int]] = {}
        self._deferred = DeferredShading(Uniforms)

    def __del__(self) -> None:
        """Nothing: it ends with the process, when OpenGL can no longer be called."""

    def _forward_pass(self, scene: Any, flags: int, seg_node_map: Any = None) -> Any:
        nodes = list(scene.mesh_nodes)
        if len(nodes) != 1 or not self._deferred.can_draw(nodes[0].mesh, flags):
            return super()._forward_pass(scene, flags, seg_node_map)
        self._configure_forward_pass_viewport(flags)
        GL.glClearColor(*scene.bg_color)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT)
        self._deferred.draw(self, scene, nodes[0], flags)
        return self._read_main_framebuffer(scene, flags)

    def _configure_main_framebuffer(self) -> None:
        former_size = self._main_fb_dims
        super()._configure_main_framebuffer()
        if self._main_fb_dims == former_size:
            return
        for buffer, content in (
            (self._main_cb_ms, GL.GL_RGBA),
            (self._main_db_ms, GL.GL_DEPTH_COMPONENT24),
        ):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, content, *self._main_fb_dims)
        width, height = self._main_fb_dims
        self._deferred.allocate(width, height, self._main_db_ms)

    def _delete_main_framebuffer(self) -> None:
        super()._delete_main_framebuffer()
        self._deferred.release()

    def _get_primitive_program(self, primitive: Any, flags: int, program_flags: int) -> Any:
        program = super()._get_primitive_program(primitive, flags, program_flags)
        if program not in self._remembering:
            self._remembering[program] = Uniforms(program)
        return self._remembering[program]

    def _compute_max_n_lights(self, flags: int) -> list[int]:
        if flags not in self._light_limits:
            self._light_limits[flags] = super()._compute_max_n_lights(flags)
        return self._light_limits[flags]

    def _read_main_framebuffer(self, scene: Any, flags: int) -> Any:
        width, height = self._main_fb_dims
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
        window_HW = np.empty((height, width), np.float32)
        GL.glReadPixels(0, 0, width, height, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, window_HW)
        camera = scene.main_camera_node.camera
        depth_HW = _metric_depth(window_HW[::-1], camera.znear, camera.zfar)
        if flags & RenderFlags.DEPTH_ONLY:
            return depth_HW
        rgba_HW4 = np.empty((height, width, 4), np.uint8)
        GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, rgba_HW4)
        return rgba_HW4[::-1] if flags & RenderFlags.RGBA else rgba_HW4[::-1, :, :3], depth_HW


class Uniforms:
    """A shader program that remembers the values of its uniforms."""

    def __init__(self, program: Any) -> None:
        self._program = program
        self._bind, self._unbind = program._bind, program._unbind
        self._values: dict[str, Any] = {}

    def set_uniform(self, name: str, value: Any) -> None:
        """Set a uniform of the program, which is bound; names that it does not have are ignored."""
        key = value.tobytes() if isinstance(value, np.ndarray) else value
        if name not in self._values or self._values[name] != key:
            self._program.set_uniform(name, value)
            self._values[name] = key


def _metric_depth(window_HW: NDArray[np.float32], near: float, far: float | None) -> NDArray[np.float32]:
    """Metres along the optical axis from window depths (0 to 1) of a perspective; 0 where nothing was drawn."""
    clip_HW = 2.0 * window_HW - 1.0
    if far is None:
        depth_HW = 2 * near / np.maximum(1.0 - clip_HW, np.finfo(np.float32).tiny)
    else:
        depth_HW = 2.0 * near * far / (far + near - clip_HW * (far - near))
    metric_HW: NDArray[np.float32] = np.where(window_HW == 1.0, np.float32(0), depth_HW)
    return metric_HW
