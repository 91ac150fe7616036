"""From a model's occupancy function to a mesh."""

from math import log
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.meshing import extract_mesh
from stereo_occ.models.base import OccupancyModel, StereoViews


def reconstruct(model: OccupancyModel, views: StereoViews, threshold: float, resolution: int) -> Trimesh:
    """The surface that the model sees in one stereo pair (``B = 1``), rig frame, metres.

    Args:
        threshold: occupancy probability at the surface.
        resolution: cells along each side of the cube ``[-0.5, 0.5]^3``.

    Returns:
        A closed mesh, empty if nothing is occupied.
    """
    device = next(model.parameters()).device
    was_training = model.training
    model.eval()
    with torch.inference_mode():
        code = model.encode(views)
        mesh = extract_mesh(
            lambda points_N3: _logits(model, code, points_N3, device),
            low=-0.5 * np.ones(3),
            high=0.5 * np.ones(3),
            resolution=resolution,
            level=log(threshold / (1 - threshold)),
        )
    model.train(was_training)
    return mesh


def _logits(
    model: OccupancyModel, code: Any, points_N3: NDArray[np.floating], device: torch.device
) -> NDArray[np.float32]:
    points_BN3 = torch.as_tensor(points_N3, dtype=torch.float32, device=device)[None]
    return model.decode_all(code, points_BN3)[0].float().cpu().numpy()
