"""Parameters and multiply-accumulates of every shipped model, as a Markdown table.

    python -m benchmarks.model_cost

Multiply-accumulates (MMAC, millions) are those of one sample's forward pass, counted by torch from the operators that
run: the encoder's share is ``encode``, the decoder's is ``decode`` of the stated query points. Convolution taps that
can only meet padding do not run and are not counted (DilatedConv).
"""

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import torch
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig, OmegaConf
from torch.utils.flop_counter import FlopCounterMode

from stereo_occ.checkpoint import plain
from stereo_occ.config import TrainConfig, register_schemas
from stereo_occ.data.rigs import build_rig
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.build import COST_VOLUMES, build_model
from stereo_occ.paths import conf_dir

MODELS = {
    "mono, resnet18": ["model=mono", "model.encoder.weights=null"],
    "mono, dilated_resnet": ["model=mono", "model/encoder=dilated_resnet"],
    **{f"stereo, {name}": ["model=stereo", f"model/cost_volume={name}"] for name in COST_VOLUMES},
    "stereo, correlation, resnet18": [
        "model=stereo",
        "model/encoder=resnet18",
        "model.encoder.weights=null",
    ],
    "pixel_stereo": ["model=pixel_stereo"],
    "plane_sweep_mono": ["model=plane_sweep_mono"],
    "plane_sweep_stereo": ["model=plane_sweep_stereo"],
    "plane_sweep_guided": ["model=plane_sweep_guided"],
    "plane_sweep_stereo, stride 2": ["model=plane_sweep_stereo", "model.feature_stride=2"],
    "plane_sweep_stereo, around the object": ["model=plane_sweep_stereo", "model.around=object"],
}


@dataclass(frozen=True)
class Size:
    """What a row is measured at."""

    image_side: int
    disparities: int
    hidden: int
    points: int

    def overrides(self) -> list[str]:
        """Overrides of ``scale``."""
        return [
            f"scale.image_side={self.image_side}",
            f"scale.disparities={self.disparities}",
            f"scale.decoder_hidden={self.hidden}",
            "scale.decoder_blocks=5",
        ]


SIZES = (Size(64, 8, 128, 512), Size(128, 16, 128, 512), Size(224, 32, 256, 2048))


def random_views(rig: StereoRig) -> StereoViews:
    """One pair of noise images with the rig's calibration."""
    left, right = torch.rand(2, 1, 3, rig.left.height, rig.left.width)
    K = torch.stack([torch.tensor(camera.K, dtype=torch.float32) for camera in rig.cameras])
    extrinsics = torch.stack(
        [torch.tensor(camera.camera_from_rig, dtype=torch.float32) for camera in rig.cameras]
    )
    return StereoViews(left, right, K[None], extrinsics[None])


@torch.no_grad()
def mmac(model: OccupancyModel, rig: StereoRig, points: int) -> tuple[float, float]:
    """Millions of multiply-accumulates of encoding one pair and of decoding ``points`` points."""
    views = random_views(rig)
    with FlopCounterMode(display=False) as encoding:
        code = model.eval().encode(views)
    with FlopCounterMode(display=False) as decoding:
        model.decode(code, torch.rand(1, points, 3) - 0.5)
    return encoding.get_total_flops() / 2e6, decoding.get_total_flops() / 2e6


def costs(size: Size, cfg: DictConfig) -> dict[str, float]:
    """Parameters and multiply-accumulates of a model."""
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, TrainConfig)
    rig = build_rig(typed.rig, size.image_side)
    model = build_model(plain(cfg.model), rig)
    encode, decode = mmac(model, rig, size.points)
    parameters = sum(p.numel() for p in model.parameters())
    return {"parameters": parameters, "encode_mmac": encode, "decode_mmac": decode}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, help="JSON file for the rows of the smallest size")
    options = parser.parse_args()
    register_schemas()
    smallest: dict[str, dict[str, float]] = {}
    print("| model | side | hidden | points | parameters, M | encode, MMAC | decode, MMAC |")
    print("|---|---|---|---|---|---|---|")
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        for name, overrides in MODELS.items():
            for size in SIZES:
                cost = costs(size, compose("train", [*overrides, *size.overrides()]))
                smallest.setdefault(name, cost)
                print(
                    f"| {name} | {size.image_side} | {size.hidden} | {size.points:,} | {cost['parameters'] / 1e6:.2f} "
                    f"| {cost['encode_mmac']:,.0f} | {cost['decode_mmac']:,.0f} |"
                )
    if options.output:
        options.output.write_text(json.dumps(smallest, indent=1) + "\n")


if __name__ == "__main__":
    main()
