"""Exported graphs answer as the models do, for any number of pairs and of points."""

from pathlib import Path

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

import stereo_occ
from stereo_occ.checkpoint import KEY, VERSION, plain
from stereo_occ.cli import compose_config
from stereo_occ.data.rigs import build_rig, draw_verging
from stereo_occ.errors import UserError
from stereo_occ.export import export
from stereo_occ.models.base import StereoViews
from stereo_occ.models.build import build_model
from stereo_occ.onnx_export import INPUTS
from stereo_occ.onnx_model import load_onnx, run
from stereo_occ.reconstructor import Reconstructor, SurfaceOptions
from stereo_occ.trained import load_trained

pytest.importorskip("onnxruntime")
pytest.importorskip("onnxscript")

EXAMPLES = Path(stereo_occ.__file__).parents[1] / "examples"
SIDE = 32

ONET = ["model.code_size=16", "model.decoder.hidden=16", "model.decoder.blocks=1"]
LIGHT = ["model.encoder.channels=8", "model.encoder.widths=[8,8,8,8]", "model.encoder.blocks=[1,1,1,1]"]
POINTS = ["model.groups=2", "model.code_size=16", "model.hidden=16", "model.blocks=1"]

#: Small, as tracing takes a time for each layer; of every part that a code may have, and of every encoder but timm's.
#: What pixel_stereo does is in plane_sweep_guided.
MODELS = {
    "stereo": ["model.width=8", "model.encoder.widths=[8,8,8]", "model.encoder.blocks=[1,1,1]", *ONET],
    "mono": ["model.encoder.weights=null", *ONET],
    "plane_sweep_guided": ["model.grid=8", "model.widths=[8,8]", *LIGHT, *POINTS],
}


def config_of(name):
    overrides = [f"model={name}", *MODELS[name], "rig=rectified", "placement=free", f"data.image_side={SIDE}"]
    return compose_config("train", overrides)


@pytest.fixture(scope="module", params=MODELS)
def exported(request, tmp_path_factory):
    """Paths of a checkpoint and of what was exported from it."""
    folder = tmp_path_factory.mktemp(request.param)
    cfg = config_of(request.param)
    torch.manual_seed(0)
    model = build_model(plain(cfg.model), build_rig(OmegaConf.to_object(cfg.rig), SIDE), load_weights=False)
    for parameter in model.parameters():
        if parameter.ndim > 1 and not parameter.any():
            torch.nn.init.normal_(parameter, std=0.1)  # or codes would have no effect
    *_, head = model.decoder.head.modules()
    torch.nn.init.normal_(head.weight, std=5)
    torch.nn.init.zeros_(head.bias)
    state = {f"model.{name}": tensor for name, tensor in model.state_dict().items()}
    content = {KEY: {"version": VERSION, "config": plain(cfg)}, "global_step": 1}
    torch.save(content | {"state_dict": state | {"threshold": torch.tensor(0.5)}}, folder / "best.ckpt")
    overrides = [
        f"checkpoint='{folder / 'best.ckpt'}'",
        f"output='{folder / 'x'}'",
        "onnx=true",
        "half=false",
    ]
    export(compose_config("export", overrides))
    return folder


def views_of(pairs):
    """Noise, seen by another pair of cameras each."""
    rng = np.random.default_rng(pairs)
    config = OmegaConf.to_object(compose_config("train", ["rig=randomised"]).rig)
    rigs = [draw_verging(config, SIDE, rng) for _ in range(pairs)]
    images = torch.as_tensor(rng.random((2, pairs, 3, SIDE, SIDE)), dtype=torch.float32)
    cameras = [
        torch.as_tensor(
            np.array([[getattr(c, field) for c in rig.cameras] for rig in rigs]), dtype=torch.float32
        )
        for field in ("K", "camera_from_rig")
    ]
    return StereoViews(images[0], images[1], *cameras)


def test_any_number_of_pairs_and_points(exported):
    trained, graphs = load_trained(str(exported / "best.ckpt")), load_onnx(str(exported / "x"))
    for pairs, points in ((1, 1), (1, 500), (3, 7)):
        views = views_of(pairs)
        points_BN3 = torch.rand(pairs, points, 3, generator=torch.Generator().manual_seed(points)) - 0.5
        with torch.inference_mode():
            expected_BN = trained.model(views, points_BN3).numpy()
        arrays = (views.left_BCHW, views.right_BCHW, views.K_B233, views.camera_from_rig_B244)
        code = run(graphs.encoder, dict(zip(INPUTS, (array.numpy() for array in arrays), strict=True)))
        logits_BN = run(graphs.decoder, {"points": points_BN3.numpy(), **code})["logits"]
        np.testing.assert_allclose(logits_BN, expected_BN, atol=1e-4)
    assert expected_BN.std() > 0.01


def test_the_same_mesh(exported):
    pair = EXAMPLES / "left.png", EXAMPLES / "right.png", EXAMPLES / "calibration.yaml"
    options = {"surface": SurfaceOptions(threshold=0.5, resolution=16, steps=0)}
    meshes = [
        Reconstructor.from_checkpoint(exported / "x", backend)(*pair, **options).mesh
        for backend in ("torch", "onnx")
    ]
    assert meshes[0].volume == pytest.approx(meshes[1].volume, rel=1e-3)
    np.testing.assert_allclose(meshes[0].bounds, meshes[1].bounds, atol=1e-3)


@pytest.mark.parametrize("part", ["encoder", "decoder"])
def test_damaged_graphs_are_named(exported, part):
    path = exported / f"x_{part}.onnx"
    whole = path.read_bytes()
    for damaged in (whole[:-100], whole[: len(whole) // 2] + b"\1" + whole[len(whole) // 2 + 1 :]):
        path.write_bytes(damaged)
        with pytest.raises(UserError, match=rf"x_{part}\.onnx: is damaged, or of another export"):
            load_onnx(str(exported / "x"))
    path.write_bytes(whole)
    load_onnx(str(exported / "x"))
