"""Deferred shading (Saito and Takahashi, SIGGRAPH 1990) with pyrender's own shaders.

A software rasteriser shades whole blocks of 4 x 4 samples, of which a small triangle covers two or three. So a first
pass stores what the fragment shader would be given, and a second runs it once for each covered sample. The shader and
its inputs are the same, so are the bits.
"""

import re
from collections.abc import Callable
from typing import Any

from stereo_occ.render.gl import import_pyrender

import_pyrender()

from OpenGL import GL  # noqa: E402 (the platform is chosen above)
from pyrender import RenderFlags  # noqa: E402
from pyrender.constants import BufFlags, ProgramFlags, TexFlags  # noqa: E402
from pyrender.shader_program import ShaderProgram  # noqa: E402

#: Inputs of the fragment shader, by the vertex attribute that they need; a position there always is.
INPUTS = {
    BufFlags.POSITION: ("vec3", "frag_position"),
    BufFlags.NORMAL: ("vec3", "frag_normal"),
    BufFlags.COLOR_0: ("vec4", "color_multiplier"),
}

#: One triangle over the whole image, as far away as nothing.
EVERYWHERE = """#version 330 core
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 1.0, 1.0);
}
"""


class DeferredShading:
    """Draws one plain mesh into the framebuffer of a ``pyrender.Renderer``, in two passes.

    Args:
        wrap: what makes of a shader program one to set uniforms with.
    """

    def __init__(self, wrap: Callable[[Any], Any]) -> None:
        self._wrap = wrap
        self._programs: dict[int, tuple[Any, Any]] = {}
        self._framebuffer: int | None = None
        self._textures: list[int] = []
        self._no_vertices: int | None = None

    def can_draw(self, mesh: Any, flags: int) -> bool:
        """Whether ``mesh`` is opaque, untextured and of one piece, to be drawn with no effect asked for."""
        if flags != RenderFlags.RGBA | RenderFlags.OFFSCREEN or len(mesh.primitives) != 1:
            return False
        primitive = mesh.primitives[0]
        return (
            mesh.is_visible
            and not mesh.is_transparent
            and primitive.buf_flags & ~sum(INPUTS) == 0
            and primitive.material.tex_flags == TexFlags.NONE
            and not primitive.material.wireframe
        )

    def allocate(self, width: int, height: int, depth_buffer: int) -> None:
        """Make room for ``width`` x ``height`` samples; ``depth_buffer`` is the one of the main framebuffer."""
        self._textures = [int(name) for name in GL.glGenTextures(len(INPUTS))]
        self._framebuffer = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._framebuffer)
        for index, texture in enumerate(self._textures):
            GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
            GL.glTexImage2D(
                GL.GL_TEXTURE_2D, 0, GL.GL_RGBA32F, width, height, 0, GL.GL_RGBA, GL.GL_FLOAT, None
            )
            for side in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
                GL.glTexParameteri(GL.GL_TEXTURE_2D, side, GL.GL_NEAREST)
            GL.glFramebufferTexture2D(
                GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0 + index, GL.GL_TEXTURE_2D, texture, 0
            )
        GL.glFramebufferRenderbuffer(
            GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, depth_buffer
        )

    def release(self) -> None:
        """Let go of the stored images."""
        if self._framebuffer is not None:
            GL.glDeleteFramebuffers(1, [self._framebuffer])
            GL.glDeleteTextures(self._textures)
            self._framebuffer = None

    def draw(self, renderer: Any, scene: Any, node: Any, flags: int) -> None:
        """Draw ``node`` into the main framebuffer of ``renderer``, whose colours have been cleared."""
        (primitive,) = node.mesh.primitives
        store, light = self._programs_for(renderer, primitive, flags)
        view, projection = renderer._get_camera_matrices(scene)

        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._framebuffer)
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        inputs = _inputs(primitive)
        GL.glDrawBuffers(len(inputs), [GL.GL_COLOR_ATTACHMENT0 + index for index in range(len(inputs))])
        store._bind()
        store.set_uniform("V", view)
        store.set_uniform("P", projection)
        renderer._bind_and_draw_primitive(primitive, scene.get_pose(node), store, flags)

        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, renderer._main_fb_ms)
        GL.glDisable(GL.GL_BLEND)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDepthMask(GL.GL_FALSE)
        GL.glDepthFunc(GL.GL_NOTEQUAL)  # the background is as far away as the triangle
        light._bind()
        for index, (_, name) in enumerate(inputs):
            GL.glActiveTexture(GL.GL_TEXTURE0 + index)
            GL.glBindTexture(GL.GL_TEXTURE_2D, self._textures[index])
            light.set_uniform(f"stored_{name}", index)
        light.set_uniform("cam_pos", scene.get_pose(scene.main_camera_node)[:3, 3])
        renderer._bind_lighting(scene, light, node, flags)
        for name in ("emissive", "base_color", "metallic", "roughness"):
            first, *rest = name.split("_")
            value = getattr(primitive.material, first + "".join(map(str.title, rest)) + "Factor")
            light.set_uniform(f"material.{name}_factor", value)
        GL.glBindVertexArray(self._no_vertices)
        GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)
        GL.glBindVertexArray(0)
        light._unbind()

    def _programs_for(self, renderer: Any, primitive: Any, flags: int) -> tuple[Any, Any]:
        """The programs of the two passes for meshes with the same vertex attributes as ``primitive``."""
        kind = primitive.buf_flags
        if kind not in self._programs:
            whole = renderer._get_primitive_program(primitive, flags, ProgramFlags.USE_MATERIAL)._program
            passes = (
                (whole.vertex_shader, _store_source(_inputs(primitive))),
                (EVERYWHERE, _light_source(whole._load(whole.fragment_shader), _inputs(primitive))),
            )
            if self._no_vertices is None:
                self._no_vertices = GL.glGenVertexArrays(1)
            programs = [_Program(*sources, defines=whole.defines) for sources in passes]
            for program in programs:
                program._add_to_context()
            store, light = map(self._wrap, programs)
            self._programs[kind] = store, light
        return self._programs[kind]


class _Program(ShaderProgram):  # type: ignore[misc]
    """A program whose shaders are given as file names or as sources."""

    def _load(self, shader: str) -> str:
        return shader if shader.startswith("#version") else str(super()._load(shader))


def _inputs(primitive: Any) -> list[tuple[str, str]]:
    return [
        declared for attribute, declared in INPUTS.items() if primitive.buf_flags & attribute == attribute
    ]


def _store_source(inputs: list[tuple[str, str]]) -> str:
    """A fragment shader that writes its inputs."""
    lines = ["#version 330 core"]
    lines += [f"in {kind} {name};" for kind, name in inputs]
    lines += [f"layout(location = {index}) out vec4 stored_{index};" for index in range(len(inputs))]
    writes = (
        f"stored_{index} = {name if kind == 'vec4' else f'vec4({name}, 1.0)'};"
        for index, (kind, name) in enumerate(inputs)
    )
    return "\n".join([*lines, "void main() {", *writes, "}"])


def _light_source(source: str, inputs: list[tuple[str, str]]) -> str:
    """The fragment shader ``source`` with its inputs read from where the first pass has stored them."""
    fetches = ""
    for kind, name in inputs:
        source, found = re.subn(
            rf"^in {kind} {name};", f"uniform sampler2D stored_{name};\n{kind} {name};", source, flags=re.M
        )
        if found != 1:
            raise RuntimeError(f"pyrender's shader has no input {name}: another version than 0.1.45?")
        parts = "xyzw"[: int(kind[-1])]
        fetches += f"    {name} = texelFetch(stored_{name}, ivec2(gl_FragCoord.xy), 0).{parts};\n"
    return re.sub(r"^(void main\(\)\s*\{)", rf"\1\n{fetches}", source, flags=re.M)
