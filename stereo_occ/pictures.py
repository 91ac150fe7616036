"""Pictures of reconstructions: left | right | predicted | true."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from trimesh import Trimesh

from stereo_occ.geometry.camera import StereoRig
from stereo_occ.render.appearance import Appearance
from stereo_occ.render.stereo import StereoRenderer

PANEL = 192  # pixels

LOOK = Appearance(
    light_from_L3=np.array([[-0.5, 0.7, 0.5], [0.8, 0.2, 0.5]]),
    light_color_L3=np.array([[1.7, 1.7, 1.7], [0.7, 0.7, 0.7]]),
    ambient=0.15,
    base_color_3=np.array([0.35, 0.5, 0.65]),
    metallic=0.0,
    roughness=0.9,
    background_3=np.full(3, 255, dtype=np.uint8),
)


def comparison(
    left_CHW: Tensor, right_CHW: Tensor, predicted: Trimesh, true: Trimesh, rig: StereoRig
) -> NDArray[np.uint8]:
    """A strip ``(PANEL, 4 * PANEL, 3)``: both inputs, then both meshes (rig frame) as the left camera sees them."""
    inputs = [enlarge(image_CHW) for image_CHW in (left_CHW, right_CHW)]
    return np.concatenate([*inputs, *(picture(mesh, rig) for mesh in (predicted, true))], axis=1)


def picture(mesh: Trimesh, rig: StereoRig, look: Appearance = LOOK) -> NDArray[np.uint8]:
    """A mesh of the rig frame as the left camera sees it ``(PANEL, PANEL, 3)``; white if it is empty."""
    if not len(mesh.faces):
        return np.full((PANEL, PANEL, 3), 255, dtype=np.uint8)
    with StereoRenderer() as renderer:
        renderer.load(mesh)
        images = renderer.render(resized(rig, PANEL), np.eye(4), look)
    return np.asarray(images.rgb_2HW3[0])


def resized(rig: StereoRig, side: int) -> StereoRig:
    """The same cameras with images of ``side`` by ``side`` pixels."""
    return StereoRig(*(camera.resized(side, side) for camera in rig.cameras))


def enlarge(image_CHW: Tensor) -> NDArray[np.uint8]:
    """An RGB image in [0, 1] as ``(PANEL, PANEL, 3)`` bytes, pixels kept visible."""
    image_HWC = torch.nn.functional.interpolate(image_CHW[None], size=(PANEL, PANEL))[0].permute(1, 2, 0)
    return np.asarray((image_HWC.clamp(0, 1) * 255).round().cpu(), dtype=np.uint8)
