"""Points per second of the inside test, and its errors on solids with a closed formula.

python -m benchmarks.contains
"""

import platform
from collections.abc import Callable
from functools import partial
from time import process_time

import embreex
import numpy as np
import trimesh
from numpy.typing import NDArray

from stereo_occ.occupancy.contains import contains
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import CATEGORIES

POINTS = 200_000
Depth = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def convex_depth(mesh: trimesh.Trimesh) -> Depth:
    """Depth below the nearest of the planes of a convex mesh's faces: exact, positive inside."""
    normals_F3, facet = np.unique(mesh.face_normals.round(9), axis=0, return_index=True)
    offsets_F = np.einsum("fi,fi->f", normals_F3, mesh.triangles[facet, 0])
    return lambda points_N3: (offsets_F - points_N3 @ normals_F3.T).min(axis=1)


def shell(outer: trimesh.Trimesh, inner: trimesh.Trimesh) -> tuple[trimesh.Trimesh, Depth]:
    """A convex solid with a convex cavity."""
    within, without = convex_depth(outer), convex_depth(inner)
    cavity = inner.copy()
    cavity.invert()
    return outer + cavity, lambda p: np.minimum(within(p), -without(p))


def solids() -> dict[str, tuple[trimesh.Trimesh, Depth]]:
    """Meshes with the depth of a point below their surface."""
    ball, cylinder = (
        trimesh.creation.icosphere(subdivisions=2),
        trimesh.creation.cylinder(0.3, 1, sections=48),
    )
    box = trimesh.creation.box((1, 1, 1))
    return {
        "ball": (ball, convex_depth(ball)),
        "cylinder": (cylinder, convex_depth(cylinder)),
        "ball shell, 1 % wall": shell(ball, ball.copy().apply_scale(0.99)),
        "box with cavity": shell(box, trimesh.creation.box((0.8, 0.9, 0.5))),
        "torus": (
            trimesh.creation.torus(1, 0.3, 400, 400),
            lambda p: 0.3 - np.hypot(np.hypot(p[:, 0], p[:, 1]) - 1, p[:, 2]),
        ),
    }


def wrong(mesh: trimesh.Trimesh, depth: Depth, points_N3: NDArray[np.float64]) -> str:
    """Errors among the points farther than 1e-4 of the box's diagonal from the surface."""
    depth_N = np.concatenate([depth(part) for part in np.array_split(points_N3, 50)])
    clear_N = np.abs(depth_N) > 1e-4 * mesh.scale
    errors_N = contains(mesh, points_N3[clear_N]) != (depth_N[clear_N] > 0)
    return f"{errors_N.sum()} of {len(errors_N)}"


def rates(*ways: Callable[[], object]) -> list[float]:
    """Millions of points per second of processor time: the best of three turns each, taken in turn."""
    best = [np.inf] * len(ways)
    for _ in range(3):
        for index, way in enumerate(ways):
            start = process_time()
            way()
            best[index] = min(best[index], process_time() - start)
    return [POINTS / seconds / 1e6 for seconds in best]


def main() -> None:
    """Print one line per solid, then one per procedural object."""
    rng = np.random.default_rng(0)
    print(f"trimesh {trimesh.__version__}, embreex {embreex.__version__}, {platform.machine()}")
    composed = solids()
    generated = {
        f"{category} {index}": procedural_shape(category, 0, index).mesh
        for category in CATEGORIES
        for index in range(2)
    }
    ratios = []
    for name, mesh in ({name: mesh for name, (mesh, _) in composed.items()} | generated).items():
        low_3, high_3 = mesh.bounds
        uniform_N3 = low_3 + (high_3 - low_3) * rng.random((POINTS, 3))
        surface_N3, _ = trimesh.sample.sample_surface(mesh, POINTS // 2, seed=0)
        close_N3 = surface_N3 + 3e-4 * mesh.scale * rng.standard_normal(surface_N3.shape)
        ours, theirs = rates(partial(contains, mesh, uniform_N3), partial(mesh.contains, uniform_N3))
        ratios.append(ours / theirs)
        line = f"{name:22s} {len(mesh.faces):6d} faces  {ours:4.2f} M points/s ({theirs:4.2f} by trimesh)"
        if name in composed:
            depth = composed[name][1]
            line += (
                f"  wrong: {wrong(mesh, depth, uniform_N3)} in the box, {wrong(mesh, depth, close_N3)} close"
            )
        print(line)
    print(f"median ratio to trimesh: {np.median(ratios):.2f}")


if __name__ == "__main__":
    main()
