"""Volumetric IoU of two meshes by exact booleans: Eq. 1 of the paper."""

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from trimesh import Trimesh


def mesh_iou(predicted: Trimesh, true: Trimesh) -> float | None:
    """Volume of the intersection over that of the union; None if one of the meshes bounds no solid."""
    a, b = _solid(predicted), _solid(true)
    if a is None or b is None:
        return None
    return min(1.0, float((a ^ b).volume() / (a + b).volume()))  # above by a solid's overlap with itself


def _solid(mesh: Trimesh) -> Manifold | None:
    # Copies: it takes no arrays that are read-only.
    solid = Manifold(Mesh64(np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.uint64)))
    return solid if solid.status() == Error.NoError and solid.volume() > 0 else None
