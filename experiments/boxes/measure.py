"""What ``reconstruct`` makes of whole photographs, by what it is told of where the object is.

Pairs of 960 x 540 pixels as a ZED Mini takes them (``rig=zed_mini``), of test objects of ``experiment=field`` in its
scenes; the weights are ``field``. Writes ``results.json`` and ``table.md`` beside this file:

    python -m experiments.boxes.measure
"""

import argparse
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from omegaconf import OmegaConf
from scipy.stats import spearmanr
from tqdm import tqdm

from experiments.whole_pairs import COLUMNS, Photographs, Told, compared, reconstructed
from stereo_occ.calibration import Lens, RealCamera, RealPair
from stereo_occ.cli import compose_config
from stereo_occ.config import TrainConfig
from stereo_occ.data.look import dressed
from stereo_occ.data.objects import list_objects, members
from stereo_occ.data.rigs import RectifiedRigConfig, draw_parallel
from stereo_occ.data.scene import Scene, draw_scene
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.provenance import environment
from stereo_occ.reconstructor import Reconstructor
from stereo_occ.render.appearance import draw_appearance
from stereo_occ.render.sensor import photograph
from stereo_occ.render.stereo import StereoRenderer

HERE = Path(__file__).parent


def by_hand(photographs: Photographs, error: float, rng: np.random.Generator) -> list[list[float]]:
    """Both boxes, every edge drawn with an error of so many pixels."""
    boxes_24 = photographs.boxes_24 + error * rng.standard_normal((2, 4))
    height, width = photographs.mask_2HW.shape[1:]
    return list(boxes_24.clip(-0.5, [width - 0.5, height - 0.5] * 2).tolist())


WAYS: dict[str, Callable[[Photographs, np.random.Generator], Told]] = {
    "masks": lambda p, rng: {"masks": tuple(p.mask_2HW)},
    "boxes, true": lambda p, rng: {"boxes": by_hand(p, 0, rng)},
    "boxes, edges off by 2 pixels": lambda p, rng: {"boxes": by_hand(p, 2, rng)},
    "boxes, edges off by 4 pixels": lambda p, rng: {"boxes": by_hand(p, 4, rng)},
    "left box alone, true": lambda p, rng: {"boxes": (by_hand(p, 0, rng)[0], None)},
    "left box alone, edges off by 4 pixels": lambda p, rng: {"boxes": (by_hand(p, 4, rng)[0], None)},
}


def whole(scene: Scene, config: RectifiedRigConfig) -> tuple[StereoRig, StereoRig]:
    """The cameras of the whole images that a scene's were cut from: as told, and as they are."""
    uncut = draw_parallel(config, np.random.default_rng(0))  # one baseline and field of view
    told, true = [], []
    for camera, cut, cut_true in zip(uncut.cameras, scene.rig.cameras, scene.true_rig.cameras, strict=True):
        size = camera.width, camera.height
        whole_from_cut = camera.K @ np.linalg.inv(cut.K)
        told.append(Camera(camera.K, cut.camera_from_rig, *size))
        true.append(Camera(whole_from_cut @ cut_true.K, cut_true.camera_from_rig, *size))
    return StereoRig(*told), StereoRig(*true)


def metric_pair(rig: StereoRig, unit: float) -> RealPair:
    """The cameras as a calibration has them."""
    poses = [camera.camera_from_rig.copy() for camera in rig.cameras]
    for pose in poses:
        pose[:3, 3] *= unit
    lens = Lens.from_list([0.0] * 5)
    left, right = (
        RealCamera(camera.K, lens, pose @ np.linalg.inv(poses[0]), (camera.width, camera.height))
        for camera, pose in zip(rig.cameras, poses, strict=True)
    )
    return RealPair(left, right)


def scenes(config: TrainConfig, count: int) -> Iterator[Photographs]:
    """Pairs of test objects by turns, each category as often."""
    assert isinstance(config.rig, RectifiedRigConfig)
    objects = members(list_objects(config, False).sources, config, "test")
    by_category = [[o for o in objects if o.category == name] for name in config.categories.names]
    with StereoRenderer() as renderer:
        for number in range(count):
            group = by_category[number % len(by_category)]
            shape = group[number // len(by_category) % len(group)].build()
            renderer.load(shape.mesh, shape.colors)
            hull_N3 = shape.mesh.convex_hull.vertices
            rngs = [np.random.default_rng([number, stream]) for stream in range(6)]
            scene = draw_scene(config.rig, config.placement, config.data.image_side, hull_N3, *rngs[:2])
            appearance = dressed(
                draw_appearance(config.lights, config.material, config.background, rngs[2]),
                config.texture,
                config.background,
                scene,
                hull_N3,
                shape.colors is not None,
                rngs[3:5],
            )
            told, true = whole(scene, config.rig)
            images = renderer.render(true, scene.pose.rig_from_object, appearance)
            rgb_2HW3 = photograph(images, true, config.sensor, appearance, False, rngs[5])
            to_metres = np.diag([scene.unit] * 3 + [1.0])
            left_from_object = to_metres @ told.left.camera_from_rig @ scene.pose.rig_from_object
            yield Photographs(
                rgb_2HW3,
                images.mask_2HW > 0,
                metric_pair(told, scene.unit),
                left_from_object,
                shape.mesh,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="pairs for each background")
    options = parser.parse_args()
    torch.set_num_threads(1)
    reconstruct = Reconstructor.from_checkpoint("field")
    results: dict[str, Any] = {"environment": environment(), "pairs": options.count}
    lines = [
        "| surroundings | told | `mesh_iou` | `confidence` | rank correlation of the two | height error | width error "
        "| centre error | failed |",
        "|---" * 9 + "|",
    ]
    for background in ("clutter", "photographs"):
        config = OmegaConf.to_object(
            compose_config("train", ["experiment=field", "rig=zed_mini", f"background={background}"])
        )
        assert isinstance(config, TrainConfig)
        values: dict[str, list[list[float]]] = {way: [] for way in WAYS}
        for number, pair in enumerate(tqdm(scenes(config, options.count), background, options.count)):
            for way, tell in WAYS.items():
                try:
                    told = tell(pair, np.random.default_rng(number))
                    found = reconstructed(reconstruct, pair, told)
                    values[way].append([*compared(found.mesh, pair), found.confidence])
                except UserError:
                    values[way].append([0.0, *[np.inf] * 3, 0.0])
        for way, rows in values.items():
            iou_P, *errors_3P, confidence_P = np.array(rows).T
            correlation = float(spearmanr(iou_P, confidence_P).statistic)
            medians = dict(zip(COLUMNS[1:], np.median(errors_3P, axis=1).tolist(), strict=True))
            failed = int(np.isinf(errors_3P[0]).sum())
            known = {name: value if np.isfinite(value) else None for name, value in medians.items()}
            means = {"mesh_iou": float(iou_P.mean()), "confidence": float(confidence_P.mean())}
            results[f"{background}, {way}"] = {
                **means,
                "rank_correlation": correlation,
                **known,
                "failed": failed,
            }
            errors = " | ".join(f"{1000 * value:.0f} mm" for value in medians.values())
            sure = f"{confidence_P.mean():.3f} | {correlation:.2f}"
            lines.append(f"| {background} | {way} | {iou_P.mean():.3f} | {sure} | {errors} | {failed} |")
    (HERE / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    (HERE / "table.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
