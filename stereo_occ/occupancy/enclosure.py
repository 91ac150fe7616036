"""What surfaces enclose that need be neither closed nor well wound, by rays in all directions."""

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector


def encloses(mesh: Trimesh, points_N3: NDArray[np.floating], count: int = 65) -> NDArray[np.bool_]:
    """Points ``(N,)`` that the surface encloses, though it may have holes, wrong winding or overlapping parts.

    A point is free if most of ``count`` rays cross the surface an even number of times *and* the mean of exits
    minus entries, its generalised winding number (Jacobson et al. 2013), is near zero: the first alone would
    free what two overlapping parts share, the second alone what a wrongly wound part encloses.
    """
    rays, direction_D3 = RayMeshIntersector(mesh), directions(count)
    enclosed_N = np.zeros(len(points_N3), bool)
    for part in np.array_split(np.arange(len(points_N3)), len(points_N3) // 500 + 1):
        origins_R3 = np.repeat(np.asarray(points_N3)[part], count, axis=0)
        exits_R, crossings_R = _crossings(mesh, rays, origins_R3, np.tile(direction_D3, (len(part), 1)))
        odd_P = (crossings_R % 2).reshape(-1, count).mean(axis=1)
        winding_P = exits_R.reshape(-1, count).mean(axis=1)
        enclosed_N[part] = (odd_P >= 0.5) | (np.abs(winding_P) >= 0.5)
    return enclosed_N


def overlap(mesh: Trimesh, rays: RayMeshIntersector, count: int = 20_000) -> float:
    """Share of the box's points about which parity and winding number of the closed mesh disagree.

    They do where parts of a surface overlap or are turned inside out. ``rays`` are those of the mesh.
    """
    low_3, high_3 = mesh.bounds
    plastic_3 = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])  # the R3 sequence
    points_N3 = low_3 + (high_3 - low_3) * (np.arange(1, count + 1)[:, None] * plastic_3 % 1)
    direction_N3 = np.broadcast_to(directions(1000)[321], points_N3.shape)
    exits_N, crossings_N = _crossings(mesh, rays, points_N3, direction_N3)
    return float(((exits_N > 0.5) != (crossings_N % 2 == 1)).mean())


def directions(count: int) -> NDArray[np.float64]:
    """Unit vectors ``(count, 3)`` spread evenly over the sphere (a Fibonacci lattice)."""
    index_D = np.arange(count) + 0.5
    height_D, turn_D = 1 - 2 * index_D / count, index_D * np.pi * (1 + np.sqrt(5))
    radius_D = np.sqrt(1 - height_D**2)
    return np.stack([radius_D * np.cos(turn_D), radius_D * np.sin(turn_D), height_D], axis=1)


def _crossings(
    mesh: Trimesh,
    rays: RayMeshIntersector,
    origins_R3: NDArray[np.floating],
    direction_R3: NDArray[np.floating],
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Exits minus entries, and the number of crossings, of each ray."""
    face_H, ray_H = rays.intersects_id(origins_R3, direction_R3)
    exits_H = np.sign(np.einsum("hi,hi->h", mesh.face_normals[face_H], direction_R3[ray_H]))
    count = len(origins_R3)
    exits_R = np.bincount(ray_H, weights=exits_H, minlength=count).astype(np.float64)
    return exits_R, np.bincount(ray_H, minlength=count)
