"""Pairs per second: one renderer for life against the naive way, a new scene and renderer for each pair.

Both draw the same objects in the same poses, in turn, each in a process of its own (deleting a renderer ends the EGL
display of its process).
"""

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from math import pi
from multiprocessing import get_context

import numpy as np

from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.pictures import LOOK
from stereo_occ.render.gl import import_pyrender
from stereo_occ.render.stereo import CV_FROM_GL, StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import CATEGORIES


def naive(category: str, side: int, pairs: int) -> float:
    """Seconds for ``pairs`` pairs as in pyrender's own examples."""
    pyrender = import_pyrender()
    rig = toed_in_rig(1.0, pi / 16, pi / 3, side)
    mesh = procedural_shape(category, 0, 0).mesh
    start = time.perf_counter()
    for pose in random_poses(pairs):
        scene = pyrender.Scene(bg_color=[1.0, 1.0, 1.0, 0.0])
        scene.add(pyrender.Mesh.from_trimesh(mesh), pose=pose)
        for _ in LOOK.light_from_L3:
            scene.add(pyrender.DirectionalLight(intensity=2.0))
        renderer = pyrender.OffscreenRenderer(side, side)
        for camera in rig.cameras:
            K = camera.K
            view = pyrender.IntrinsicsCamera(K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5)
            node = scene.add(view, pose=np.linalg.inv(camera.camera_from_rig) @ CV_FROM_GL)
            scene.main_camera_node = node
            renderer.render(scene, pyrender.RenderFlags.RGBA)
        renderer.delete()
    return time.perf_counter() - start


def ours(category: str, side: int, pairs: int) -> float:
    """Seconds for ``pairs`` pairs, loading the object included."""
    rig = toed_in_rig(1.0, pi / 16, pi / 3, side)
    mesh = procedural_shape(category, 0, 0).mesh
    with StereoRenderer() as renderer:
        start = time.perf_counter()
        renderer.load(mesh)
        for pose in random_poses(pairs):
            renderer.render(rig, pose, LOOK)
        return time.perf_counter() - start


def random_poses(count: int) -> list[np.ndarray]:
    """The same poses for both."""
    poses = [np.eye(4) for _ in range(count)]
    for pose, rotation in zip(poses, random_rotations(count, np.random.default_rng(0)), strict=True):
        pose[:3, :3] = rotation
    return poses


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=20, help="pairs per object and turn")
    parser.add_argument("--turns", type=int, default=3)
    options = parser.parse_args()
    print(f"{'side':>5} {'naive pairs/s':>14} {'ours pairs/s':>13} {'ratio':>6}")
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as first,
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as second,
    ):
        for side in (64, 128):
            seconds = [0.0, 0.0]
            for turn in range(options.turns + 1):
                for category in CATEGORIES:
                    for way, (pool, function) in enumerate(((first, naive), (second, ours))):
                        spent = pool.submit(function, category, side, options.pairs).result()
                        seconds[way] += spent if turn else 0.0  # the first turn warms up
            slow, fast = (options.pairs * len(CATEGORIES) * options.turns / spent for spent in seconds)
            print(f"{side:>5} {slow:>14.1f} {fast:>13.1f} {fast / slow:>6.1f}", flush=True)


if __name__ == "__main__":
    main()
