"""pyrender's renderer without what costs time and shows nothing here.

On a software rasteriser at 64 pixels a third of pyrender's time is bookkeeping. The pixels stay the same to the bit.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def renderer_class(module: Any) -> type[Any]:
    """A subclass of ``pyrender.renderer.Renderer`` (given its module) for :class:`stereo_occ.render.stereo`.

    - One sample per pixel in place of four, which would take most of the time.
    - Pixels are read where they were drawn, not from a copy.
    - A uniform is sent when its value is new: of one object most stay the same from view to view.
    """

    class Renderer(module.Renderer):  # type: ignore[misc]
        def __init__(self, width: int, height: int) -> None:
            super().__init__(width, height)
            self._uniforms: dict[Any, _Uniforms] = {}
            self._light_limits: dict[int, list[int]] = {}

        def _configure_main_framebuffer(self) -> None:
            former_size = self._main_fb_dims
            super()._configure_main_framebuffer()
            if self._main_fb_dims == former_size:
                return
            for buffer, content in (
                (self._main_cb_ms, module.GL_RGBA),
                (self._main_db_ms, module.GL_DEPTH_COMPONENT24),
            ):
                module.glBindRenderbuffer(module.GL_RENDERBUFFER, buffer)
                module.glRenderbufferStorage(module.GL_RENDERBUFFER, content, *self._main_fb_dims)

        def _get_primitive_program(self, primitive: Any, flags: int, program_flags: int) -> Any:
            program = super()._get_primitive_program(primitive, flags, program_flags)
            if program not in self._uniforms:
                self._uniforms[program] = _Uniforms(program)
            return self._uniforms[program]

        def _compute_max_n_lights(self, flags: int) -> list[int]:
            if flags not in self._light_limits:
                self._light_limits[flags] = super()._compute_max_n_lights(flags)
            return self._light_limits[flags]

        def _read_main_framebuffer(self, scene: Any, flags: int) -> Any:
            area = (0, 0, *self._main_fb_dims)
            shape = self._main_fb_dims[::-1]
            module.glBindFramebuffer(module.GL_READ_FRAMEBUFFER, self._main_fb_ms)
            window_HW = np.empty(shape, np.float32)
            module.glReadPixels(*area, module.GL_DEPTH_COMPONENT, module.GL_FLOAT, window_HW)
            camera = scene.main_camera_node.camera
            depth_HW = _metric_depth(window_HW[::-1], camera.znear, camera.zfar)
            if flags & module.RenderFlags.DEPTH_ONLY:
                return depth_HW
            rgba_HW4 = np.empty((*shape, 4), np.uint8)
            module.glReadPixels(*area, module.GL_RGBA, module.GL_UNSIGNED_BYTE, rgba_HW4)
            return rgba_HW4[::-1] if flags & module.RenderFlags.RGBA else rgba_HW4[::-1, :, :3], depth_HW

    return Renderer


class _Uniforms:
    """A shader program that remembers the values of its uniforms."""

    def __init__(self, program: Any) -> None:
        self._program = program
        self._bind, self._unbind = program._bind, program._unbind
        self._values: dict[str, Any] = {}

    def set_uniform(self, name: str, value: Any) -> None:
        key = value.tobytes() if isinstance(value, np.ndarray) else value
        if name not in self._values or self._values[name] != key:
            self._program.set_uniform(name, value)
            self._values[name] = key


def _metric_depth(window_HW: NDArray[np.float32], near: float, far: float | None) -> NDArray[np.float32]:
    """Metres along the optical axis from the depths of a perspective window (0 to 1); 0 where nothing was drawn."""
    clip_HW = 2.0 * window_HW - 1.0
    with np.errstate(divide="ignore"):
        depth_HW = (
            2 * near / (1.0 - clip_HW)
            if far is None
            else 2.0 * near * far / (far + near - clip_HW * (far - near))
        )
    depth_HW[window_HW == 1.0] = 0.0
    return depth_HW
