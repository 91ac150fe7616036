"""Pairs per second: one renderer for life against the naive way, a new scene and renderer for each pair.

All draw the same objects in the same poses, in turn, each way in a process of its own (deleting a renderer ends the
EGL display of its process). Rates are per second of processor time, so that other work on the machine counts little.
"""

import argparse
import os
import platform
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from functools import partial
from importlib.metadata import version
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
    """Seconds for ``pairs`` pairs as in pyrender's own examples, with its 4x multisampling."""
    pyrender = import_pyrender()
    rig = toed_in_rig(1.0, pi / 16, pi / 3, side)
    mesh = procedural_shape(category, 0, 0).mesh
    start = time.process_time()
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
    return time.process_time() - start


def ours(supersampling: int, category: str, side: int, pairs: int) -> float:
    """Seconds for ``pairs`` pairs, loading the object included."""
    rig = toed_in_rig(1.0, pi / 16, pi / 3, side)
    mesh = procedural_shape(category, 0, 0).mesh
    with StereoRenderer(supersampling) as renderer:
        start = time.process_time()
        renderer.load(mesh)
        for pose in random_poses(pairs):
            renderer.render(rig, pose, LOOK)
        return time.process_time() - start


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
    os.environ |= {"LP_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    versions = ", ".join(f"{name} {version(name)}" for name in ("pyrender", "PyOpenGL", "numpy"))
    print(f"{versions}, {platform.machine()}, one rasteriser thread; pairs per CPU second (times naive)")
    ways: dict[str, Callable[[str, int, int], float]] = {
        "naive, 4x multisampled": naive,
        "ours, supersampling 2": partial(ours, 2),
        "ours, supersampling 1": partial(ours, 1),
    }
    print(f"{'side':>5}" + "".join(f"{name:>26}" for name in ways))
    with ExitStack() as stack:
        pools = [stack.enter_context(ProcessPoolExecutor(1, get_context("spawn"))) for _ in ways]
        for side in (64, 128):
            seconds = np.zeros(len(ways))
            for turn in range(options.turns + 1):
                for category in CATEGORIES:
                    for index, (pool, way) in enumerate(zip(pools, ways.values(), strict=True)):
                        spent = pool.submit(way, category, side, options.pairs).result()
                        seconds[index] += spent if turn else 0.0  # the first turn warms up
            rates = options.pairs * len(CATEGORIES) * options.turns / seconds
            cells = (f"{rate:.1f} ({rate / rates[0]:.1f})" for rate in rates)
            print(f"{side:>5}" + "".join(f"{cell:>26}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
