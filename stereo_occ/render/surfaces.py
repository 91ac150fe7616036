"""Textured, mirroring and cluttered scenes, which pyrender's own shader cannot draw.

The object and the things around it are drawn in two passes (deferred shading; Saito and Takahashi, SIGGRAPH 1990):
``shaders/store.frag`` stores what is seen by each sample, ``shaders/light.frag`` colours it, once per sample however
many triangles there are. With nothing switched on the pictures agree with pyrender's.
"""

from collections.abc import Sequence
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from stereo_occ.geometry.camera import Camera
from stereo_occ.render.appearance import MAX_LIGHTS
from stereo_occ.render.buffers import STORED, Targets, VertexArray
from stereo_occ.render.finish import Finish
from stereo_occ.render.gl import import_pyrender, process_renderer
from stereo_occ.render.shadows import ACROSS, SIDE, ShadowMaps
from stereo_occ.render.vertices import SceneLight

import_pyrender()

from OpenGL import GL  # noqa: E402 (the platform is chosen above)
from OpenGL.GL import shaders  # noqa: E402

#: Limits of the shader; the object is thing 0.
MAX_THINGS = 16

#: What is nearer or farther than this along the optical axis is not drawn; units of the rig frame.
NEAR, FAR = 0.05, 200.0

#: How far off a surface its shadow is looked up, texels of the map.
LIFT = 2.0


class SurfaceDrawing:
    """Draws one object and the things around it with programs and buffers of its own, which live with the process."""

    def __init__(self) -> None:
        self._make_current()
        self._store = _linked("store.vert", "store.frag")
        self._light = _linked("everywhere.vert", "light.frag")
        self._shadow = _linked("store.vert", "shadow.frag")
        self._shadow_maps = ShadowMaps(MAX_LIGHTS)
        self._object, self._things = VertexArray(), VertexArray()
        self._no_vertices = GL.glGenVertexArrays(1)
        self._targets: dict[tuple[int, int], Targets] = {}
        self._places: dict[str, int] = {}

    def load_object(self, vertices_V15: NDArray[np.float32], faces_F3: NDArray[np.integer]) -> None:
        """The object, in its own frame."""
        self._make_current()
        self._object.fill(vertices_V15, faces_F3)

    def load_things(self, vertices_V15: NDArray[np.float32], faces_F3: NDArray[np.integer]) -> None:
        """All that is around it, rig frame; none if there are no faces."""
        self._make_current()
        self._things.fill(vertices_V15, faces_F3)

    def set_look(
        self, finishes: Sequence[Finish], contacts_C4: NDArray[np.float64], light: SceneLight
    ) -> None:
        """How all things of the next pictures look: the object's finish first, then in the order of their numbers."""
        self._make_current()
        GL.glUseProgram(self._light)
        packed = np.zeros((MAX_THINGS, 4, 4), np.float32)
        packed[: len(finishes)] = [finish.packed() for finish in finishes]
        GL.glUniform4fv(self._at("finishes"), 4 * MAX_THINGS, packed)
        GL.glUniform1i(self._at("contact_count"), len(contacts_C4))
        if len(contacts_C4):
            GL.glUniform4fv(self._at("contacts"), len(contacts_C4), contacts_C4.astype(np.float32))
        GL.glUniform1i(self._at("light_count"), len(light.from_L3))
        for name, values_L3 in (("light_from", light.from_L3), ("light_color", light.color_L3)):
            if len(values_L3):
                GL.glUniform3fv(self._at(name), len(values_L3), values_L3.astype(np.float32))
        GL.glUniform1f(self._at("ambient"), light.ambient)
        GL.glUniform3f(self._at("up"), *light.up_3)
        for unit, name in enumerate((*(f"stored_{name}" for name in STORED), "shadow_maps")):
            GL.glUniform1i(self._at(name), unit)

    def cast_shadows(self, rig_from_object: NDArray[np.float64], light: SceneLight) -> None:
        """Find what the lights of the next pictures do not reach."""
        self._make_current()
        edge = light.shadow if len(light.from_L3) else None
        GL.glUseProgram(self._light)
        GL.glUniform1f(self._at("shadow_edge"), -1.0 if edge is None else edge / (2 * ACROSS))
        if edge is None:
            return
        diagonal = np.cbrt(np.linalg.det(rig_from_object[:3, :3]))
        GL.glUniform1f(self._at("shadow_lift"), LIFT * 2 * ACROSS * diagonal / SIDE)
        middle_3 = rig_from_object[:3, 3]

        def draw(clip_from_rig: NDArray[np.float64]) -> None:
            self._draw_all(self._shadow, clip_from_rig, rig_from_object, np.eye(4))

        maps_L44 = self._shadow_maps.draw(light.from_L3, middle_3, float(diagonal), draw)
        GL.glUseProgram(self._light)
        GL.glUniformMatrix4fv(
            self._at("map_from_rig"), len(maps_L44), GL.GL_TRUE, maps_L44.astype(np.float32)
        )

    def samples(
        self,
        camera: Camera,
        rig_from_object: NDArray[np.float64],
        texture_from_object: NDArray[np.float64],
        double_sided: bool,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """What a camera sees: colour ``(H, W, 4)``, whose alpha is the object, and the object's depth ``(H, W)``."""
        self._make_current()
        size = camera.width, camera.height
        if size not in self._targets:
            for targets in self._targets.values():
                targets.delete()
            self._targets = {size: Targets(*size)}
        targets = self._targets[size]
        GL.glViewport(0, 0, *size)
        GL.glDisable(GL.GL_BLEND)
        self._store_pass(targets, camera, rig_from_object, texture_from_object, double_sided)
        self._light_pass(targets, camera)
        return targets.read()

    def _store_pass(
        self,
        targets: Targets,
        camera: Camera,
        rig_from_object: NDArray[np.float64],
        texture_from_object: NDArray[np.float64],
        double_sided: bool,
    ) -> None:
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, targets.store)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDepthFunc(GL.GL_LESS)
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        # Patterns are filtered by their differences to the next pixel, at an outline to one that is not drawn.
        for index in range(len(STORED)):
            GL.glClearBufferfv(GL.GL_COLOR, index, np.zeros(4, np.float32))
        (GL.glDisable if double_sided else GL.glEnable)(GL.GL_CULL_FACE)
        GL.glCullFace(GL.GL_BACK)
        clip_from_rig = _clip_from_camera(camera) @ camera.camera_from_rig
        self._draw_all(self._store, clip_from_rig, rig_from_object, texture_from_object)

    def _draw_all(
        self,
        program: int,
        clip_from_rig: NDArray[np.float64],
        rig_from_object: NDArray[np.float64],
        texture_from_object: NDArray[np.float64],
    ) -> None:
        GL.glUseProgram(program)
        _set_matrix(program, "clip_from_rig", clip_from_rig)
        _set_matrix(program, "rig_from_model", rig_from_object)
        _set_matrix(program, "texture_from_model", texture_from_object)
        self._object.draw()
        if self._things.count:
            for name in ("rig_from_model", "texture_from_model"):
                _set_matrix(program, name, np.eye(4))
            self._things.draw()

    def _light_pass(self, targets: Targets, camera: Camera) -> None:
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, targets.light)
        GL.glClearBufferfv(GL.GL_COLOR, 0, np.zeros(4, np.float32))
        GL.glClearBufferfv(GL.GL_COLOR, 1, np.zeros(4, np.float32))
        GL.glDepthMask(GL.GL_FALSE)
        GL.glDepthFunc(GL.GL_GREATER)  # only where something was drawn
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glUseProgram(self._light)
        for unit, texture in enumerate(targets.textures):
            GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
            GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
        GL.glActiveTexture(GL.GL_TEXTURE0 + len(targets.textures))
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, self._shadow_maps.texture)
        GL.glUniform3f(self._at("camera_position"), *camera.center)
        GL.glUniform4f(self._at("depth_from_rig"), *camera.camera_from_rig[2])
        GL.glBindVertexArray(self._no_vertices)
        GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)
        GL.glBindVertexArray(0)
        GL.glUseProgram(0)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDepthFunc(GL.GL_LESS)
        GL.glActiveTexture(GL.GL_TEXTURE0)

    def _at(self, name: str) -> int:
        if name not in self._places:
            self._places[name] = int(GL.glGetUniformLocation(self._light, name))
        return self._places[name]

    @staticmethod
    def _make_current() -> None:
        process_renderer(1, 1)._platform.make_current()


def _linked(*names: str) -> int:
    # Validation looks at the state of the moment, in which the samplers are not set yet.
    return int(shaders.compileProgram(*(_compiled(name) for name in names), validate=False))


def _compiled(name: str) -> int:
    kind = GL.GL_VERTEX_SHADER if name.endswith(".vert") else GL.GL_FRAGMENT_SHADER
    source = (files("stereo_occ.render") / "shaders" / name).read_text()
    return int(shaders.compileShader(source, kind))


def _set_matrix(program: int, name: str, matrix_44: NDArray[np.float64]) -> None:
    place = GL.glGetUniformLocation(program, name)
    GL.glUniformMatrix4fv(place, 1, GL.GL_TRUE, matrix_44.astype(np.float32))


def _clip_from_camera(camera: Camera) -> NDArray[np.float64]:
    """OpenGL's projection of an OpenCV camera: what looks along +Z here has w = z."""
    K, width, height = camera.K, camera.width, camera.height
    return np.array(
        [
            [2 * K[0, 0] / width, 0, 2 * (K[0, 2] + 0.5) / width - 1, 0],
            [0, -2 * K[1, 1] / height, 1 - 2 * (K[1, 2] + 0.5) / height, 0],
            [0, 0, (FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)],
            [0, 0, 1, 0],
        ]
    )
