"""Multi-resolution iso-surface extraction against the full grid: points evaluated and seconds.

The occupancy function is a thin-walled cup, plus nothing times a multi-layer perceptron of the decoder's
size, so that a point costs what it costs in practice.

    python -m benchmarks.meshing
"""

from importlib.metadata import version
from time import perf_counter

import numpy as np
import torch
from numpy.typing import NDArray
from skimage.measure import marching_cubes
from torch import nn

from stereo_occ.meshing import sample_field

LOW, HIGH = -0.5 * np.ones(3), 0.5 * np.ones(3)


class Cup:
    """Logits of an open cup with 12 mm walls, at the price of five blocks of 128 channels per point."""

    def __init__(self) -> None:
        layers = [layer for _ in range(10) for layer in (nn.Linear(128, 128), nn.ReLU())]
        self.network = nn.Sequential(nn.Linear(3, 128), *layers, nn.Linear(128, 1)).eval()
        self.points = 0

    @torch.inference_mode()
    def __call__(self, points_N3: NDArray[np.float32]) -> NDArray[np.float32]:
        self.points += len(points_N3)
        price_N = 0 * self.network(torch.from_numpy(points_N3))[:, 0].numpy()
        radius_N = np.hypot(points_N3[:, 0], points_N3[:, 2])
        outer_N = np.minimum(0.25 - radius_N, 0.35 - np.abs(points_N3[:, 1]))
        inner_N = np.minimum(0.238 - radius_N, points_N3[:, 1] + 0.338)
        return np.asarray(price_N + 50 * np.minimum(outer_N, -inner_N), dtype=np.float32)


def full_grid(occupancy: Cup, resolution: int) -> int:
    """Faces of the mesh from every sample of the grid."""
    axis_A = np.linspace(-0.5, 0.5, resolution + 1, dtype=np.float32)
    points_N3 = np.stack(np.meshgrid(axis_A, axis_A, axis_A, indexing="ij"), axis=-1).reshape(-1, 3)
    logits = [occupancy(part_N3) for part_N3 in np.array_split(points_N3, len(points_N3) // 65536 + 1)]
    values = np.concatenate(logits).reshape((resolution + 1,) * 3)
    return len(marching_cubes(values, 0.0, gradient_direction="ascent")[1])


def main() -> None:
    """Print one line per resolution."""
    versions = ", ".join(f"{name} {version(name)}" for name in ("scikit-image", "torch", "numpy"))
    print(f"{versions}, {torch.get_num_threads()} thread(s)")
    for resolution in (64, 128):
        sparse, dense = Cup(), Cup()
        start = perf_counter()
        faces = len(sample_field(sparse, LOW, HIGH, resolution).surface().faces)
        middle = perf_counter()
        same = full_grid(dense, resolution) == faces
        seconds, dense_seconds = middle - start, perf_counter() - middle
        print(
            f"{resolution}^3: {sparse.points / dense.points:.3f} of {dense.points} points, "
            f"{seconds:.2f} s against {dense_seconds:.2f} s, {faces} faces, same mesh: {same}"
        )


if __name__ == "__main__":
    main()
