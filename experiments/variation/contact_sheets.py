"""Draw a contact sheet per group of variations: three objects, several draws of each, left beside right.

Rigs add a third picture to each pair: the left image in red over the right one in cyan, with an epipolar line of
each quarter of the image where the cameras as told to the model put it.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from omegaconf import OmegaConf
from PIL import Image, ImageDraw

from stereo_occ.cli import compose_config
from stereo_occ.config import RenderConfig
from stereo_occ.data.pairs import render_views
from stereo_occ.data.shard import Views
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape

SIDE, GAP = 112, 6  # pixels
OBJECTS = (("mug", 3), ("bowl", 5), ("bottle", 8))

FIELD = ["rig=rectified", "placement=table", "lights=room", "material=glossy", "texture=procedural"]

DESK = ["background=clutter", "placement=table", "placement.diagonal=[0.5,0.7]"]

#: What each sheet shows: overrides, and whether the rig is what varies.
SHEETS: dict[str, tuple[list[str], bool]] = {
    "paper": ([], False),
    "lights": (["lights=random"], False),
    "shadows": (["lights=room", *DESK], False),
    "material": (["material=varied"], False),
    "glossy": (["material=glossy", "lights=random"], False),
    "texture": (["texture=procedural", "texture.share=1"], False),
    "placement": (["placement=table"], False),
    "clutter": (DESK, False),
    "photographs": (["background=photographs", *DESK[1:]], False),
    "occlusion": ([*DESK, "background.clutter.occlusion=0.4", "background.clutter.things=[10,12]"], False),
    "masked": (["background=clutter", "background.masked=true", "sensor=noisy", "placement=table"], False),
    "sensor": (["sensor=noisy"], False),
    "harsh": (["sensor=harsh", "background=clutter", "placement=table"], False),
    "rig_randomised": (["rig=randomised", "placement=free"], True),
    "rig_rectified": (["rig=rectified", "placement=free", "background=clutter"], True),
    "everything": ([*FIELD, "background=clutter", "sensor=noisy"], True),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(SHEETS), help=f"of {', '.join(SHEETS)}")
    parser.add_argument("--folder", type=Path, default=Path(__file__).parent)
    options = parser.parse_args()
    with StereoRenderer() as renderer:
        for name in options.names:
            overrides, rigs = SHEETS[name]
            sheet = contact_sheet(overrides, rigs, renderer)
            sheet.quantize(256).save(options.folder / f"{name}.png", optimize=True)


def contact_sheet(overrides: list[str], rigs: bool, renderer: StereoRenderer) -> Image.Image:
    """One row per object, one cell per draw."""
    draws = 4 if rigs else 6
    cfg = compose_config("render", [*overrides, f"data.image_side={SIDE}", f"data.views={draws}"])
    pairs = OmegaConf.to_object(cfg)
    assert isinstance(pairs, RenderConfig)
    rows = []
    for number, (category, index) in enumerate(OBJECTS):
        views = render_views(procedural_shape(category, 0, index), pairs, [0, number], renderer)
        cells = [cell(views, view, rigs) for view in range(draws)]
        rows.append(np.concatenate(cells, axis=1))
    return Image.fromarray(np.concatenate(rows))


def cell(views: Views, view: int, rigs: bool) -> NDArray[np.uint8]:
    """Left | right, and for rigs their overlay, with a grey margin."""
    left, right = views.rgb[view]
    panels = [left, right, *([overlay(views, view)] if rigs else [])]
    return np.pad(np.concatenate(panels, axis=1), ((GAP, GAP), (GAP, GAP), (0, 0)), constant_values=128)


def overlay(views: Views, view: int) -> NDArray[np.uint8]:
    """Both pictures in one, and epipolar lines in the right one of points of the left one's object."""
    left, right = (picture.mean(axis=-1).astype(np.uint8) for picture in views.rgb[view])
    image = Image.fromarray(np.stack([left, right, right], axis=-1))
    drawing = ImageDraw.Draw(image)
    v, u = np.nonzero(views.mask[view, 0] == 255)
    for share, color in zip((0.02, 0.35, 0.65, 0.98), ("orange", "lime", "magenta", "blue"), strict=True):
        at = int(share * (len(v) - 1))
        depth = float(views.depth[view, 0, v[at], u[at]])
        line = epipolar_line(views, view, np.array([u[at], v[at], 1.0]), depth)
        drawing.line([tuple(point) for point in line], fill=color)
        drawing.ellipse([u[at] - 2, v[at] - 2, u[at] + 2, v[at] + 2], outline=color)
        x, y = line[len(line) // 2]
        drawing.rectangle([x - 2, y - 2, x + 2, y + 2], outline=color)
    return np.asarray(image)


def epipolar_line(views: Views, view: int, pixel_3: NDArray[np.float64], depth: float) -> NDArray[np.float64]:
    """Where the right camera sees the left one's ray, from 70 % to 130 % of its depth; its own depth in the middle."""
    K_233, camera_from_rig_244 = views.K[view], views.camera_from_rig[view]
    points_N3 = np.linalg.solve(K_233[0], pixel_3) * (depth * np.linspace(0.7, 1.3, 7))[:, None]
    right_from_left = camera_from_rig_244[1] @ np.linalg.inv(camera_from_rig_244[0])
    seen_N3 = (points_N3 @ right_from_left[:3, :3].T + right_from_left[:3, 3]) @ K_233[1].T
    return np.asarray(seen_N3[:, :2] / seen_N3[:, 2:])


if __name__ == "__main__":
    main()
