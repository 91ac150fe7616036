"""Stereo pairs of one object: colour, coverage and metric depth."""

from dataclasses import dataclass
from importlib import import_module
from types import TracebackType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.render.appearance import MAX_LIGHTS, Appearance
from stereo_occ.render.gl import import_pyrender, process_renderer
from stereo_occ.render.normals import split_at_creases
from stereo_occ.render.openness import openness
from stereo_occ.render.pixels import center_depth, mean_color, over
from stereo_occ.render.texture import plain_finish
from stereo_occ.render.vertices import SceneLight, object_vertices, surroundings

#: Edges sharper than this stay sharp.
CREASE_ANGLE = np.radians(40)

#: OpenGL cameras look along -Z with +Y up.
CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class StereoImages:
    """Left and right, in this order.

    Attributes:
        rgb_2HW3: display values, the object over its background.
        mask_2HW: coverage of the pixel by the object, 0 to 255.
        depth_2HW: along the optical axis at the pixel's centre, metres; 0 where all of the pixel is background.
    """

    rgb_2HW3: NDArray[np.uint8]
    mask_2HW: NDArray[np.uint8]
    depth_2HW: NDArray[np.float32]


class StereoRenderer:
    """Renders one object at a time, in any number of poses, rigs and appearances.

    Args:
        supersampling: samples along each side of a pixel; 2 is closer to the truth at outlines than OpenGL's 4x
            multisampling (PSNR 25.8 dB against 25.0 dB at 64 pixels; experiments/antialiasing) in half the time.
    """

    def __init__(self, supersampling: int = 2) -> None:
        self._supersampling = supersampling
        self._pyrender = import_pyrender()
        self._flags = self._pyrender.RenderFlags.RGBA
        self._scene = _lit_scene(self._pyrender)
        self._camera = self._pyrender.IntrinsicsCamera(1, 1, 0, 0)
        self._camera_node = self._scene.add(self._camera)
        self._light_nodes = [self._scene.add(self._pyrender.DirectionalLight()) for _ in range(MAX_LIGHTS)]
        self._material = self._pyrender.MetallicRoughnessMaterial()
        self._mesh_node: Any = None
        self._surfaces: Any = None
        self._surfaces_open: bool | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the object."""
        if self._mesh_node is not None:
            self._scene.remove_node(self._mesh_node)
            self._mesh_node = None

    def load(self, mesh: Trimesh, colors_V3: NDArray[np.uint8] | None = None) -> None:
        """Make ``mesh`` (object frame) the one that is rendered; ``colors_V3`` are its vertices' own, sRGB."""
        self.close()
        if np.linalg.det(mesh.triangles).sum() < 0:  # six times the volume; trimesh warns where there is none
            mesh = mesh.copy()
            mesh.invert()
        source_V, normals_V3, faces_F3 = split_at_creases(mesh, CREASE_ANGLE)
        positions_V3 = mesh.vertices[source_V]
        self._material.doubleSided = not mesh.is_volume
        primitive = self._pyrender.Primitive(
            positions=positions_V3, normals=normals_V3, indices=faces_F3, material=self._material
        )
        self._mesh_node = self._scene.add(self._pyrender.Mesh([primitive]))
        self._surfaces_open = None
        own_V3 = None if colors_V3 is None else colors_V3[source_V]
        self._parts = mesh, positions_V3, normals_V3, own_V3, faces_F3

    def render(
        self, rig: StereoRig, rig_from_object: NDArray[np.float64], appearance: Appearance
    ) -> StereoImages:
        """Render the loaded object; surfaces nearer than 5 cm or farther than 100 m are not drawn.

        Args:
            rig: any two cameras without skew whose images have the same size.
            rig_from_object: 4x4 similarity: rotation times scale, translation in metres.

        Raises:
            UserError: if the cameras are not so, the transform mirrors or OpenGL cannot be started.
            RuntimeError: if no object is loaded.
        """
        if self._mesh_node is None:
            raise RuntimeError("load an object before rendering")
        _check_rig(rig)
        if not np.linalg.det(rig_from_object[:3, :3]) > 0:
            raise UserError(f"rig_from_object: must not mirror the object, got {rig_from_object.tolist()}")
        if appearance.plain:
            self._scene.set_pose(self._mesh_node, rig_from_object)
            self._set_appearance(appearance)
            views = [self._samples(camera) for camera in rig.cameras]
        else:
            views = self._surface_samples(rig, rig_from_object, appearance)
        rgba_2HW4 = mean_color(np.stack([rgba for rgba, _ in views]), self._supersampling)
        alone = appearance.clutter is None
        return StereoImages(
            rgb_2HW3=over(rgba_2HW4, appearance.background_3) if alone else rgba_2HW4[..., :3],
            mask_2HW=rgba_2HW4[..., 3],
            depth_2HW=center_depth(np.stack([depth for _, depth in views]), self._supersampling),
        )

    def _set_appearance(self, appearance: Appearance) -> None:
        self._scene.ambient_light = np.full(3, appearance.ambient)
        self._scene.lit = self._light_nodes[: len(appearance.light_from_L3)]
        lights = zip(self._scene.lit, appearance.light_from_L3, appearance.light_color_L3, strict=True)
        for node, from_3, color_3 in lights:
            node.light.color = color_3
            pose = np.eye(4)
            pose[:3, 2] = from_3  # a light shines along its -Z
            self._scene.set_pose(node, pose)
        self._material.baseColorFactor = [*appearance.base_color_3, 1.0]
        self._material.metallicFactor = appearance.metallic
        self._material.roughnessFactor = appearance.roughness

    def _surface_samples(
        self, rig: StereoRig, rig_from_object: NDArray[np.float64], appearance: Appearance
    ) -> list[tuple[NDArray[np.uint8], NDArray[np.float32]]]:
        """As :meth:`_samples`; the colour of what is not the object is not weighted by its alpha, which is 0."""
        if self._surfaces is None:
            self._surfaces = import_module("stereo_occ.render.surfaces").SurfaceDrawing()  # needs OpenGL
        self._load_surfaces(appearance.shadow is not None)
        finish, clutter = appearance.finish or plain_finish(appearance), appearance.clutter
        self._surfaces.load_things(*surroundings(clutter))
        light = SceneLight(
            appearance.light_from_L3,
            appearance.light_color_L3,
            appearance.ambient,
            np.array([0.0, 1.0, 0.0]) if clutter is None else clutter.up_3,
            appearance.shadow,
        )
        finishes = [finish, *([] if clutter is None else clutter.finishes)]
        self._surfaces.set_look(finishes, np.zeros((0, 4)) if clutter is None else clutter.contacts_C4, light)
        self._surfaces.cast_shadows(rig_from_object, light)
        factor = self._supersampling
        return [
            self._surfaces.samples(
                camera.resized(factor * camera.width, factor * camera.height),
                rig_from_object,
                finish.texture_from_object,
                self._material.doubleSided,
            )
            for camera in rig.cameras
        ]

    def _load_surfaces(self, shadowed: bool) -> None:
        if self._surfaces_open == shadowed:
            return
        mesh, positions_V3, normals_V3, own_V3, faces_F3 = self._parts
        open_V = openness(mesh, positions_V3, normals_V3) if shadowed else np.ones(len(positions_V3))
        self._surfaces.load_object(object_vertices(positions_V3, normals_V3, own_V3, open_V), faces_F3)
        self._surfaces_open = shadowed

    def _samples(self, camera: Camera) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Premultiplied colour and coverage ``(H, W, 4)`` and depth ``(H, W)`` of the samples of all pixels."""
        factor = self._supersampling
        K = camera.resized(factor * camera.width, factor * camera.height).K
        self._camera.fx, self._camera.fy = K[0, 0], K[1, 1]
        # OpenGL measures the principal point from the corner of the image, we from the centre of its first pixel.
        self._camera.cx, self._camera.cy = K[0, 2] + 0.5, K[1, 2] + 0.5
        self._scene.set_pose(self._camera_node, np.linalg.inv(camera.camera_from_rig) @ CV_FROM_GL)
        renderer = process_renderer(factor * camera.width, factor * camera.height)
        rgba, depth = renderer.render(self._scene, self._flags)
        return rgba, depth


def _check_rig(rig: StereoRig) -> None:
    sizes = [(camera.width, camera.height) for camera in rig.cameras]
    if sizes[0] != sizes[1]:
        raise UserError(f"rig: images must have one size, left is {sizes[0]} and right {sizes[1]} pixels")
    for name, camera in zip(("left", "right"), rig.cameras, strict=True):
        if camera.K[0, 1] != 0:
            raise UserError(f"rig.{name}.K: skew cannot be rendered, set K[0, 1] to 0, got {camera.K[0, 1]}")


def _lit_scene(pyrender: Any) -> Any:
    """An empty scene before a transparent background.

    pyrender adds up all lights of a scene, in the order of a set, which differs between processes and with it the
    rounding of a colour. Here those in ``lit`` count, in their order.
    """

    class Scene(pyrender.Scene):  # type: ignore[misc]
        lit: ClassVar[list[Any]] = []

        @property
        def directional_light_nodes(self) -> list[Any]:
            return self.lit

        @property
        def light_nodes(self) -> list[Any]:
            return self.lit

    return Scene(bg_color=[0, 0, 0, 0])
