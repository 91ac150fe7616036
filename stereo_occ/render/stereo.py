"""Stereo pairs of one object: colour, coverage and metric depth."""

from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.render.appearance import MAX_LIGHTS, Appearance
from stereo_occ.render.gl import import_pyrender, process_renderer
from stereo_occ.render.normals import split_at_creases

#: Edges sharper than this stay sharp.
CREASE_ANGLE = np.radians(40)

#: Samples of a pixel whose depths differ by more than this share are not of one surface.
DEPTH_STEP = 0.02

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
        supersampling: samples along each side of a pixel; 2 equals OpenGL's own 4x multisampling at silhouettes
            (PSNR 23.9 dB against 24.1 dB at 64 pixels) in less time.
    """

    def __init__(self, supersampling: int = 2) -> None:
        self._supersampling = supersampling
        self._pyrender = import_pyrender()
        flags = self._pyrender.RenderFlags
        self._flags = flags.RGBA
        self._scene = self._pyrender.Scene(bg_color=[0, 0, 0, 0])
        self._camera = self._pyrender.IntrinsicsCamera(1, 1, 0, 0)
        self._camera_node = self._scene.add(self._camera)
        self._light_nodes = [self._scene.add(self._pyrender.DirectionalLight()) for _ in range(MAX_LIGHTS)]
        self._material = self._pyrender.MetallicRoughnessMaterial()
        self._mesh_node: Any = None

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

    def load(self, mesh: Trimesh) -> None:
        """Make ``mesh`` (object frame) the one that is rendered."""
        self.close()
        if mesh.volume < 0:
            mesh = mesh.copy()
            mesh.invert()
        positions_V3, normals_V3, faces_F3 = split_at_creases(mesh, CREASE_ANGLE)
        self._material.doubleSided = not mesh.is_volume
        primitive = self._pyrender.Primitive(
            positions=positions_V3, normals=normals_V3, indices=faces_F3, material=self._material
        )
        self._mesh_node = self._scene.add(self._pyrender.Mesh([primitive]))

    def render(
        self, rig: StereoRig, rig_from_object: NDArray[np.float64], appearance: Appearance
    ) -> StereoImages:
        """Render the loaded object.

        Args:
            rig: both images must have the same size.
            rig_from_object: 4x4 similarity: rotation times scale, translation in metres.
        """
        if self._mesh_node is None:
            raise RuntimeError("load an object before rendering")
        self._scene.set_pose(self._mesh_node, rig_from_object)
        self._set_appearance(appearance)
        views = [self._view(camera) for camera in rig.cameras]
        rgba_2HW4 = np.stack([rgba for rgba, _ in views])
        alpha = rgba_2HW4[..., 3:].astype(np.uint16)
        rgb = rgba_2HW4[..., :3] + ((255 - alpha) * appearance.background_3 + 127) // 255
        return StereoImages(rgb.astype(np.uint8), rgba_2HW4[..., 3], np.stack([depth for _, depth in views]))

    def _set_appearance(self, appearance: Appearance) -> None:
        self._scene.ambient_light = np.full(3, appearance.ambient)
        for index, node in enumerate(self._light_nodes):
            if index < len(appearance.light_from_L3):
                node.light.color = appearance.light_color_L3[index]
                node.light.intensity = 1.0
                pose = np.eye(4)
                pose[:3, 2] = appearance.light_from_L3[index]
                self._scene.set_pose(node, pose)
            else:
                node.light.intensity = 0.0
        self._material.baseColorFactor = [*appearance.base_color_3, 1.0]
        self._material.metallicFactor = appearance.metallic
        self._material.roughnessFactor = appearance.roughness

    def _view(self, camera: Camera) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Premultiplied colour and coverage ``(H, W, 4)``, depth ``(H, W)``."""
        factor = self._supersampling
        scale = np.array([factor, factor, 1])[:, None]
        K = scale * camera.K
        self._camera.fx, self._camera.fy = K[0, 0], K[1, 1]
        # OpenGL measures the principal point from the corner of the image, we from the centre of its first pixel.
        self._camera.cx, self._camera.cy = K[0, 2] + factor / 2, K[1, 2] + factor / 2
        self._scene.set_pose(self._camera_node, np.linalg.inv(camera.camera_from_rig) @ CV_FROM_GL)
        renderer = process_renderer(factor * camera.width, factor * camera.height)
        rgba, depth = renderer.render(self._scene, self._flags)
        return _mean_color(rgba, factor), _center_depth(depth, factor)


def _blocks(samples: NDArray[Any], factor: int) -> NDArray[Any]:
    """The ``factor`` by ``factor`` samples of each pixel ``(H, W, factor^2, ...)``."""
    height, width = samples.shape[0] // factor, samples.shape[1] // factor
    blocks = samples.reshape(height, factor, width, factor, *samples.shape[2:]).swapaxes(1, 2)
    return blocks.reshape(height, width, factor * factor, *samples.shape[2:])


def _mean_color(rgba: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    sums = _blocks(rgba, factor).sum(axis=2, dtype=np.uint16)
    mean: NDArray[np.uint8] = ((sums + factor * factor // 2) // (factor * factor)).astype(np.uint8)
    return mean


def _center_depth(depth: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Depth at the centres of pixels; where the samples are not of one surface, that of the nearest.

    Inverse depth is linear over the image of a plane, so its mean over a pixel is its value at the centre.
    """
    samples = _blocks(depth, factor)
    inverse = np.divide(1, samples, out=np.zeros_like(samples), where=samples > 0)
    nearest = inverse.max(axis=2)
    smooth = inverse.min(axis=2) > (1 - DEPTH_STEP) * nearest
    inverse_at_center = np.where(smooth, inverse.mean(axis=2), nearest)
    depth_HW: NDArray[np.float32] = np.divide(
        1, inverse_at_center, out=np.zeros_like(nearest), where=nearest > 0
    )
    return depth_HW
