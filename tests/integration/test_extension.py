"""The example of docs/extend.md, taken from the page: trained and evaluated without a change to the package."""

import json
import re
from pathlib import Path

import pytest
from runs import program

import stereo_occ
from stereo_occ.checkpoint import read_checkpoint
from stereo_occ.errors import UserError
from stereo_occ.models import build, extension
from stereo_occ.models.encoders import ImageEncoder

PAGE = Path(stereo_occ.__file__).parents[1] / "docs" / "extend.md"


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE.read_text(), flags=re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the reader has made by following the page."""
    folder = tmp_path_factory.mktemp("reader")
    (python,), (yaml,) = blocks("python"), blocks("yaml")
    (folder / "my_parts.py").write_text(python)
    (folder / "my_conf" / "experiment").mkdir(parents=True)
    (folder / "my_conf" / "experiment" / "mine.yaml").write_text(yaml)
    return folder


def test_the_example_is_short():
    assert sum(len(block.splitlines()) for block in (*blocks("python"), *blocks("yaml"))) <= 48
    (python,) = blocks("python")
    assert len([line for line in python.splitlines() if line.strip()]) < 40


def test_parts_of_ones_own_are_trained_and_evaluated(workshop, run, folder):
    common = [o for o in workshop.overrides() if not o.startswith("model.encoder")]
    quick = ["steps=2", "validation.interval=2", "logger=none"]
    settings = ["--config-dir", "my_conf", "experiment=mine", "model.cost_volume.scale=0.5"]
    trained = program(
        "-m", "stereo_occ.train", *settings, *common, *quick, "hydra.run.dir=run",
        cwd=folder, STEREO_OCC_PLUGINS="my_parts",
    )  # fmt: skip
    assert (trained.returncode, trained.stderr) == (0, "")
    checkpoint = read_checkpoint(folder / "run" / "best.ckpt")
    model = checkpoint["stereo_occ"]["config"]["model"]
    assert model["encoder"] == {"name": "plain", "channels": 32}
    assert model["cost_volume"] == {"name": "difference", "scale": 0.5}
    assert checkpoint["state_dict"]["model.encoder.layers.2.weight"].shape == (32, 32, 5, 5)
    measured = [
        "-m", "stereo_occ.evaluate", "checkpoint=run/best.ckpt", f"paths.data={workshop.root / 'data'}",
        "views=2", "points=500", "meshes=0", "workers=1", "progress=false", "hydra.run.dir=evaluation",
    ]  # fmt: skip
    refused = program(*measured, cwd=folder)
    assert refused.returncode == 2
    assert refused.stderr.startswith("stereo_occ: model.encoder: unknown 'plain'; known are ")
    assert refused.stderr.endswith("docs/extend.md tells how to add one\n")
    evaluated = program(*measured, cwd=folder, STEREO_OCC_PLUGINS="my_parts")
    assert evaluated.returncode == 0, evaluated.stderr
    assert 0 <= json.loads((folder / "evaluation" / "metrics.json").read_text())["metrics"]["test/iou"] <= 1


def test_settings_of_a_part_are_checked_as_all_others(folder):
    refused = program(
        "-m", "stereo_occ.train", "model/encoder=plain", "model.encoder.channels=many", "model.encoder.chanels=3",
        cwd=folder, STEREO_OCC_PLUGINS="my_parts",
    )  # fmt: skip
    assert refused.stderr.splitlines() == [
        "stereo_occ: model.encoder.channels=many: must be a whole number",
        "stereo_occ: model.encoder.chanels: unknown key; did you mean model.encoder.channels?",
    ]
    refused = program(
        "-m", "stereo_occ.train", "model/cost_volume=difference", "rig=randomised",
        cwd=folder, STEREO_OCC_PLUGINS="my_parts",
    )  # fmt: skip
    assert refused.stderr.startswith(
        "stereo_occ: model.cost_volume.name=difference: has the disparities of one rig"
    )


def test_a_module_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setenv("STEREO_OCC_PLUGINS", "no_such_parts")
    with pytest.raises(UserError, match=r"STEREO_OCC_PLUGINS=no_such_parts: no such module"):
        extension.load_extensions()


@pytest.mark.parametrize(
    ("name", "text", "line", "reason"),
    [
        ("parts_misspelt", "x = 1\ndef f(:\n", 2, "SyntaxError: "),
        (
            "parts_that_raise",
            'x = 1\n\nraise RuntimeError("first\\nsecond")\n',
            3,
            "RuntimeError: first second; ",
        ),
        ("parts_that_need_more", "import no_such_library\n", 1, "ModuleNotFoundError: No module named"),
    ],
)
def test_a_module_that_fails_is_one_line_with_its_place(tmp_path, monkeypatch, name, text, line, reason):
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("STEREO_OCC_PLUGINS", name)
    with pytest.raises(UserError) as refused:
        extension.load_extensions()
    message = str(refused.value)
    assert message.startswith(f"STEREO_OCC_PLUGINS={name}: {tmp_path / name}.py, line {line}: {reason}")
    assert len(message.splitlines()) == 1


def test_a_name_belongs_to_one_part():
    with pytest.raises(
        UserError, match=r"model/encoder=light: is stereo_occ.models.light.LightEncoder already"
    ):
        extension.encoder("light")(ImageEncoder)


def test_a_setting_that_no_configuration_can_hold(monkeypatch):
    class Odd(ImageEncoder):
        def __init__(self, *, sizes: set[int]):
            super().__init__()

    monkeypatch.setattr(extension, "ENCODERS", dict(build.ENCODERS))
    with pytest.raises(UserError, match=r"model/encoder=odd: .*settings are int, float, bool, str or lists"):
        extension.encoder("odd")(Odd)
