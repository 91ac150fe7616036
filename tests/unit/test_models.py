"""Whole models, from the shipped configuration."""

from math import pi
from pathlib import Path

import pytest
import torch
import yaml
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.errors import ConfigCompositionException
from omegaconf import OmegaConf

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.models.base import StereoViews
from stereo_occ.models.build import COST_VOLUMES, DECODERS, ENCODERS, MODELS, build_model
from stereo_occ.models.config import register_schemas

CONF = Path(__file__).parents[2] / "conf"
LAPTOP = {"image_side": 64, "decoder_hidden": 128, "decoder_blocks": 5, "disparities": 8}
PAPER = {"image_side": 224, "decoder_hidden": 256, "decoder_blocks": 5, "disparities": 32}
SCRATCH = "model.encoder.weights=null"
MONO = ["model=mono", SCRATCH]


@pytest.fixture(scope="module", autouse=True)
def conf():
    """The shipped ``conf/model`` under a primary configuration that holds a scale."""
    store = ConfigStore.instance()
    register_schemas(store)
    for name, scale in (("laptop", LAPTOP), ("paper", PAPER)):
        store.store(
            name=f"test_models_{name}", node={"defaults": [{"model": "stereo"}, "_self_"], "scale": scale}
        )
    with initialize_config_dir(str(CONF), version_base="1.3"):
        yield


def model_config(*overrides: str, scale="laptop"):
    composed = compose(f"test_models_{scale}", list(overrides))
    return OmegaConf.to_container(composed.model, resolve=True, throw_on_missing=True)


def rig(side):
    return toed_in_rig(distance=1.0, half_angle=pi / 16, fov=pi / 3, side=side)


def build(*overrides: str, scale="laptop", side=64):
    torch.manual_seed(0)
    return build_model(model_config(*overrides, scale=scale), rig(side))


def random_views(batch, side=64, seed=0):
    generator = torch.Generator().manual_seed(seed)
    left, right = torch.rand(2, batch, 3, side, side, generator=generator)
    cameras = rig(side).cameras
    K = torch.stack([torch.tensor(c.K) for c in cameras]).float()
    extrinsics = torch.stack([torch.tensor(c.camera_from_rig) for c in cameras]).float()
    return StereoViews(left, right, K.expand(batch, -1, -1, -1), extrinsics.expand(batch, -1, -1, -1))


def leave_zero(model):
    """Give parameters that start at 0 some value, as the first steps of training do."""
    for parameter in model.parameters():
        if not parameter.any():
            torch.nn.init.normal_(parameter, std=0.02)
    return model


@pytest.mark.parametrize(
    ("overrides", "scale", "side", "count"),
    [
        (["model=stereo"], "laptop", 64, 4_969_609),
        (["model=stereo"], "paper", 224, 7_353_993),
        (MONO, "laptop", 64, 13_048_129),
        (["model=mono_scratch"], "laptop", 64, 13_048_129),
        (MONO, "paper", 224, 14_984_769),
        (["model/cost_volume=correlation_signed"], "laptop", 64, 4_971_921),
        (["model/cost_volume=groupwise"], "laptop", 64, 4_967_881),
        (["model/cost_volume=concat"], "laptop", 64, 4_973_065),
        (["model/cost_volume=plane_sweep"], "laptop", 64, 4_969_609),
        (["model/encoder=resnet18", SCRATCH], "laptop", 64, 2_316_089),
        (["model=mono", "model/encoder=dilated_resnet"], "laptop", 64, 4_492_769),
        (["model=pixel_stereo"], "laptop", 64, 1_203_217),
        (["model=pixel_stereo", "model.feature_stride=2"], "laptop", 64, 1_222_321),
        (["model=plane_sweep_stereo"], "laptop", 64, 2_963_825),
        (["model=plane_sweep_stereo"], "paper", 224, 2_963_825),
        (["model=plane_sweep_stereo", "model.views=left"], "laptop", 64, 2_963_825),
        (["model=plane_sweep_stereo", "model/encoder=dilated_resnet"], "laptop", 64, 4_841_985),
        (["model=plane_sweep_guided"], "laptop", 64, 2_978_930),
        (["model=plane_sweep_guided_mono"], "laptop", 64, 2_978_930),  # the same
    ],
)
def test_parameter_counts(overrides, scale, side, count):
    assert sum(p.numel() for p in build(*overrides, scale=scale, side=side).parameters()) == count


@pytest.mark.parametrize("kind", ["encoder", "cost_volume", "decoder", "."])
def test_every_shipped_file_is_tested_and_every_name_is_shipped(kind):
    known = {"encoder": ENCODERS, "cost_volume": COST_VOLUMES, "decoder": DECODERS, ".": MODELS}[kind]
    files = {path.stem: yaml.safe_load(path.read_text()) for path in (CONF / "model" / kind).glob("*.yaml")}
    bases = {file["defaults"][0].removeprefix("base_") for file in files.values()}
    assert bases - (files.keys() - set(known)) == set(known)  # some begin with another file


@pytest.mark.parametrize("backbone", ["resnet10t", "convnext_atto", "mobilenetv4_conv_small"])
def test_networks_of_timm_of_unlike_families_serve_as_encoders(backbone):
    model = build(
        "model=pixel_stereo",
        "model/encoder=timm",
        "model.encoder.pretrained=false",
        f"model.encoder.backbone={backbone}",
    )
    points = torch.rand(2, 40, 3) - 0.5
    logits = model(random_views(2), points)
    assert logits.shape == (2, 40)
    assert logits.std() > 0


@pytest.mark.parametrize("encoder", ENCODERS)
@pytest.mark.parametrize(
    "name", ["mono", "pixel_stereo", "plane_sweep_stereo", "plane_sweep_guided", *COST_VOLUMES]
)
def test_every_combination_builds_and_every_parameter_learns(name, encoder):
    choice = ["model=stereo", f"model/cost_volume={name}"] if name in COST_VOLUMES else [f"model={name}"]
    scratch = {"resnet18": [SCRATCH], "timm": ["model.encoder.pretrained=false"]}.get(encoder, [])
    model = leave_zero(build(*choice, f"model/encoder={encoder}", *scratch))
    points = torch.rand(3, 40, 3) - 0.5
    logits = model(random_views(3), points)
    assert logits.shape == (3, 40)
    torch.nn.functional.binary_cross_entropy_with_logits(logits, (points[..., 0] > 0).float()).backward()
    silent = [name for name, p in model.named_parameters() if p.grad is None or p.grad.abs().max() < 1e-7]
    if encoder == "timm":  # mobilenet has biases that the next batch norm takes away
        silent = [parameter for parameter in silent if not parameter.endswith(".bias")]
    assert silent == []


def test_mono_ignores_the_right_image_and_stereo_does_not():
    views = random_views(2)
    other = StereoViews(
        views.left_BCHW, random_views(2, seed=1).right_BCHW, views.K_B233, views.camera_from_rig_B244
    )
    for overrides, same in ((MONO, True), (["model=stereo"], False)):
        model = build(*overrides).eval()
        with torch.no_grad():
            assert torch.equal(model.encode(views), model.encode(other)) is same


def test_stereo_encodes_left_and_right_with_the_same_weights_but_different_parts():
    model = build("model=stereo").eval()
    views = random_views(2)
    swapped = StereoViews(views.right_BCHW, views.left_BCHW, views.K_B233, views.camera_from_rig_B244)
    seen = []
    model.cost_volume.register_forward_hook(lambda module, inputs, output: seen.append(inputs))
    with torch.no_grad():
        codes = model.encode(views), model.encode(swapped)
        left, right = model.encoder(views.left_BCHW), model.encoder(views.right_BCHW)
    torch.testing.assert_close(seen[0][:2], (left, right))
    torch.testing.assert_close(seen[1][:2], (right, left))
    assert not torch.allclose(*codes)


@pytest.mark.parametrize("overrides", [["model=stereo"], MONO])
def test_eval_answers_depend_neither_on_the_batch_nor_on_the_number_of_points(overrides):
    model = leave_zero(build(*overrides))
    views, points = random_views(3), torch.rand(3, 60, 3) - 0.5
    model(views, points)
    model.eval()
    alone = StereoViews(*(getattr(views, field)[1:2] for field in StereoViews.__dataclass_fields__))
    with torch.no_grad():
        torch.testing.assert_close(
            model(views, points)[1:2, :7], model(alone, points[1:2, :7]), atol=1e-4, rtol=1e-4
        )


@pytest.mark.parametrize("overrides", [["model=stereo"], MONO])
def test_a_small_model_fits_two_samples(overrides):
    model = build(*overrides, "model.decoder.hidden=32", "model.decoder.blocks=1")
    views, points = random_views(2), torch.rand(2, 64, 3) - 0.5
    target = (points[..., 0] > 0).float()
    target[1] = 1 - target[1]  # only the images tell the samples apart
    optimizer = torch.optim.Adam(model.parameters(), lr=3e-3)
    for _ in range(15):
        loss = torch.nn.functional.binary_cross_entropy_with_logits(model(views, points), target)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert loss < 0.2


def test_convolutions_are_laid_out_channels_last():
    model = build("model=stereo")
    assert model.encoder.stem[0].weight.is_contiguous(memory_format=torch.channels_last)
    assert model.summary.volume[0][0].weight.is_contiguous(memory_format=torch.channels_last_3d)


def test_null_disparities_take_the_range_of_the_rig():
    groupwise = build("model/cost_volume=groupwise", "model.cost_volume.disparities=null")
    signed = build("model/cost_volume=correlation_signed")
    assert groupwise.cost_volume.disparities == signed.cost_volume.disparities == tuple(range(-2, 7))
    assert build("model=stereo").cost_volume.disparities == tuple(range(8))


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["model.widht=8"], "widht"),
        (["model.encoder.chanels=8"], "chanels"),
        (["model=pixel_stereo", "model.gird=8"], "gird"),
        (["model=pixel_stereo", "+model/cost_volume=concat"], "'cost_volume' not in 'PixelStereoConfig'"),
        (["model.width=wide"], "full_key: model.width"),
        (["model.cost_volume.disparities=[1]"], "full_key: model.cost_volume.disparities"),
        (["model=mono", "model/cost_volume=concat"], "No match in the defaults list"),
        (["model=mono", "+model/cost_volume=concat"], "'cost_volume' not in 'MonoConfig'"),
    ],
)
def test_a_misspelt_key_or_wrong_type_does_not_compose(overrides, message):
    with pytest.raises(ConfigCompositionException) as caught:
        model_config(*overrides)
    assert message in f"{caught.value}\n{caught.value.__cause__}"


def changed(path, value):
    config = model_config("model=stereo")
    *parents, last = path.split(".")
    node = config
    for parent in parents:
        node = node[parent]
    node[last] = value
    return config


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (
            "name",
            "sterio",
            "model: unknown 'sterio'; known are stereo, mono, pixel_stereo, plane_sweep_stereo; did",
        ),
        (
            "encoder.name",
            "resnet81",
            "model.encoder: unknown 'resnet81'; known are dilated_resnet, resnet18, light, timm; did you",
        ),
        ("cost_volume.name", "concatenate", "did you mean concat?"),
        ("decoder.name", "os.system", "model.decoder: unknown 'os.system'; known are onet"),
        ("encoder._target_", "os.system", "model.encoder=dilated_resnet: has no setting _target_"),
        (
            "decoder",
            {"name": "onet", "hidden": 8},
            "model.decoder=onet: lacks the setting blocks; it takes blocks, hid",
        ),
        ("name", "mono", "model=mono: has no setting cost_volume"),
        ("decoder.hidden", 0, "model.decoder.hidden: must be at least 1, got 0"),
        ("encoder.widths", [8, 0, 8], "model.encoder.widths: must be at least 1, got [8, 0, 8]"),
        ("cost_volume.disparities", 0, "model.cost_volume.disparities: must be at least 1, got 0"),
        ("feature_stride", 2, "model.feature_stride: dilated_resnet has features at strides [4, 16], got 2"),
    ],
)
def test_settings_that_make_no_model_are_named(path, value, message):
    with pytest.raises(UserError) as caught:
        build_model(changed(path, value), rig(64))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_image_sides_the_encoder_cannot_take_are_refused():
    with pytest.raises(
        UserError, match=r"data\.image_side: .*dilated_resnet takes multiples of 16 pixels, got 72 x 72"
    ):
        build_model(model_config("model=stereo"), rig(72))


def test_weights_are_not_fetched_where_a_state_dict_follows(monkeypatch):
    monkeypatch.setattr("stereo_occ.models.pretrained.load_pretrained", lambda *_: pytest.fail("fetched"))
    fresh = build_model(model_config("model=mono"), rig(64), load_weights=False)
    scratch = build(*MONO)
    fresh.load_state_dict(scratch.state_dict())


@pytest.mark.parametrize("count", [1, 4097, 10000])
def test_points_answered_in_pieces_get_the_answer_they_get_at_once(count):
    model = build("model=stereo").eval()
    code, points_BN3 = torch.randn(2, 512), torch.rand(2, count, 3) - 0.5
    with torch.inference_mode():
        torch.testing.assert_close(model.decode_all(code, points_BN3), model.decode(code, points_BN3))


@pytest.mark.parametrize(
    "overrides", [["model=stereo"], ["model=pixel_stereo"], ["model=plane_sweep_guided"]], ids=str
)
def test_no_points_have_no_answers(overrides):
    model = build(*overrides).eval()
    with torch.no_grad():
        assert model.decode_all(model.encode(random_views(1)), torch.zeros(1, 0, 3)).shape == (1, 0)
