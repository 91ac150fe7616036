"""Ways of antialiasing at the objects' outlines: PSNR against 8 x 8 samples a pixel, and a picture to look at.

python -m experiments.antialiasing.compare
"""

import argparse
import time
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.pictures import LOOK
from stereo_occ.render.gl import import_pyrender, process_renderer
from stereo_occ.render.stereo import StereoImages, StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import CATEGORIES

FOLDER = Path(__file__).parent
REFERENCE = 8
WAYS = ("one sample", "2 x 2 samples (ours)", "OpenGL 4x multisampling")


class Multisampled(StereoRenderer):
    """Draws with pyrender's own renderer, which has OpenGL's 4x multisampling."""

    _plain: Any = None

    def render(self, *arguments: Any) -> StereoImages:
        offscreen = process_renderer(1, 1)
        if Multisampled._plain is None:
            offscreen._platform.make_current()
            Multisampled._plain = import_pyrender().renderer.Renderer(1, 1)
        ours, offscreen._renderer = offscreen._renderer, Multisampled._plain
        try:
            return super().render(*arguments)
        finally:
            offscreen._renderer = ours


def renderers() -> dict[str, StereoRenderer]:
    """One of each way, and the reference."""
    ways = (StereoRenderer(1), StereoRenderer(2), Multisampled(1), StereoRenderer(REFERENCE))
    return dict(zip((*WAYS, "reference"), ways, strict=True))


def psnr(squared_errors: list[np.ndarray]) -> float:
    """Decibels of 8-bit values."""
    return float(10 * np.log10(255**2 / np.concatenate(squared_errors).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, default=6, help="of each category")
    parser.add_argument("--poses", type=int, default=20, help="of each object")
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    lines = [
        "| side | way | outline, dB | coverage, dB | inside, dB | ms/pair |",
        "|---|---|---|---|---|---|",
    ]
    for side in (64, 128):
        rig = toed_in_rig(1.0, pi / 16, pi / 3, side)
        errors: dict[str, dict[str, list[np.ndarray]]] = {
            way: {"rim": [], "mask": [], "in": []} for way in WAYS
        }
        seconds = dict.fromkeys(WAYS, 0.0)
        for category in CATEGORIES:
            for index in range(options.objects):
                shape = procedural_shape(category, 0, index)
                poses = [np.eye(4) for _ in range(options.poses)]
                for pose, rotation in zip(poses, random_rotations(options.poses, rng), strict=True):
                    pose[:3, :3] = rotation
                images = {}
                for way, renderer in renderers().items():
                    renderer.load(shape.mesh)
                    renderer.render(rig, poses[0], LOOK)
                    start = time.process_time()
                    images[way] = [renderer.render(rig, pose, LOOK) for pose in poses]
                    if way in WAYS:
                        seconds[way] += time.process_time() - start
                    renderer.close()
                for way in WAYS:
                    for image, true in zip(images[way], images["reference"], strict=True):
                        rim = (true.mask_2HW > 0) & (true.mask_2HW < 255)
                        off = (image.rgb_2HW3.astype(float) - true.rgb_2HW3) ** 2
                        errors[way]["rim"].append(off[rim].ravel())
                        errors[way]["in"].append(off[true.mask_2HW == 255].ravel())
                        errors[way]["mask"].append(((image.mask_2HW.astype(float) - true.mask_2HW) ** 2)[rim])
        pairs = len(CATEGORIES) * options.objects * options.poses
        for way in WAYS:
            figures = [
                *(psnr(errors[way][part]) for part in ("rim", "mask", "in")),
                1000 * seconds[way] / pairs,
            ]
            lines.append(f"| {side} | {way} | " + " | ".join(f"{figure:.1f}" for figure in figures) + " |")
    table = "\n".join(lines)
    print(table)
    (FOLDER / "table.md").write_text(table + "\n")
    draw_examples()


def draw_examples() -> None:
    """One object of each category, 64 pixels, every way, eightfold."""
    rig = toed_in_rig(1.0, pi / 16, pi / 3, 64)
    rotations = random_rotations(3, np.random.default_rng(4))
    figure, axes = plt.subplots(3, 4, figsize=(12.8, 9.8))
    for row, (category, rotation) in enumerate(zip(CATEGORIES, rotations, strict=True)):
        pose = np.eye(4)
        pose[:3, :3] = rotation
        for axis, (way, renderer) in zip(axes[row], renderers().items(), strict=True):
            renderer.load(procedural_shape(category, 0, 1).mesh)
            axis.imshow(renderer.render(rig, pose, LOOK).rgb_2HW3[0], interpolation="nearest")
            renderer.close()
            axis.set_axis_off()
            if row == 0:
                axis.set_title(way if way in WAYS else f"{REFERENCE} x {REFERENCE} samples")
    figure.tight_layout()
    figure.savefig(FOLDER / "outlines.png", dpi=100)


if __name__ == "__main__":
    main()
