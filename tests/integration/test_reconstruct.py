"""``reconstruct`` and ``export`` as a whole: the example pair, every kind of file, mistakes that leave nothing."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from checkpoints import checkpoint_of
from PIL import Image
from runs import program
from samples import single_line

import stereo_occ
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.export import check_export, export
from stereo_occ.problems import find_problems
from stereo_occ.reconstruct import check_reconstruction, reconstruct_pair
from stereo_occ.reconstructor import Reconstructor
from stereo_occ.trained import load_trained

EXAMPLES = Path(stereo_occ.__file__).parents[1] / "examples"
PAIR = [f"left={EXAMPLES / 'left.png'}", f"right={EXAMPLES / 'right.png'}"]
COARSE = ["resolution=16", "threshold=0.5", "threads=null"]


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    return checkpoint_of(tmp_path_factory.mktemp("run"))


def reconstruct(checkpoint, output, *more, calibration=EXAMPLES / "calibration.yaml"):
    given = [
        *PAIR,
        f"calibration='{calibration}'",
        f"checkpoint='{checkpoint}'",
        f"output='{output}'",
        *COARSE,
    ]
    keys = {override.partition("=")[0] for override in more}
    given = [override for override in given if override.partition("=")[0] not in keys]
    return reconstruct_pair(compose_config("reconstruct", [*given, *more]))


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply", "stl"])
def test_the_example_pair_to_every_kind_of_file(checkpoint, suffix, tmp_path):
    output = tmp_path / "Tasse ä" / f"mug.v1.{suffix}"
    result = reconstruct(checkpoint, output)
    read = trimesh.load(output, force="mesh")
    assert read.is_watertight
    assert read.volume == pytest.approx(result.mesh.volume, rel=1e-3)
    np.testing.assert_allclose(read.bounds, result.mesh.bounds, atol=1e-6)
    assert sorted(path.name for path in output.parent.iterdir()) == [
        f"mug.v1.{suffix}", "mug.v1.json", "mug.v1_preview.png",
    ] or suffix > "json"  # fmt: skip
    said = json.loads(output.with_suffix(".json").read_text())
    assert said["frame"] == "left"
    assert said["threshold"] == 0.5
    with Image.open(output.with_name("mug.v1_preview.png")) as preview:
        assert preview.size == (960, 270 + 480)


def test_the_rig_frame_and_the_way_back(checkpoint, tmp_path):
    result = reconstruct(checkpoint, tmp_path / "mug.ply", "frame=rig", "preview=false")
    read = trimesh.load(tmp_path / "mug.ply")
    said = json.loads((tmp_path / "mug.json").read_text())
    np.testing.assert_allclose(said["center"], read.bounds.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(said["extents"], read.extents, atol=1e-6)
    read.apply_transform(said["left_from_rig"])
    np.testing.assert_allclose(read.bounds, result.mesh.bounds, atol=1e-6)
    assert not (tmp_path / "mug_preview.png").exists()


def test_the_command_line_takes_rig(checkpoint, tmp_path):
    done = program(
        "-m", "stereo_occ.reconstruct", *PAIR, f"rig={EXAMPLES / 'calibration.yaml'}", f"checkpoint={checkpoint}",
        "output=mug.glb", "threshold=0.5", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "m forward of the left camera, confidence" in done.stdout
    assert {path.name for path in tmp_path.iterdir()} == {"mug.glb", "mug.json", "mug_preview.png"}


def test_a_mistake_is_one_line_exit_code_2_and_no_file(checkpoint, tmp_path):
    done = program(
        "-m", "stereo_occ.reconstruct", *PAIR, f"rig={EXAMPLES / 'calibration.yaml'}", f"checkpoint={checkpoint}",
        "output=mug.glb", "unit=mm", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "stereo_occ: rig: the cameras are 8e-05 m apart, expected 0.005 to 3.0 m; set unit="
    ]
    assert not list(tmp_path.iterdir())


def test_what_is_missing_is_named_as_it_is_given(tmp_path):
    done = program("-m", "stereo_occ.reconstruct", cwd=tmp_path)
    assert done.returncode == 2
    assert "stereo_occ: rig: no value given; add rig=..." in done.stderr.splitlines()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ("left=none.png", "left=none.png: no such file"),
        ("calibration=none.yaml", "rig=none.yaml: no such file"),
        ("output=mug.xyz", "must end in one of .glb, .obj, .ply, .stl"),
        ("threshold=1.5", "must be a probability"),
        ("resolution=5000", "must be 8 to 512 cells"),
        ("steps=-1", "must be 0 to 20"),
        ("simplify=2", "must be metres above 0"),
        ("frame=world", "must be one of left, rig"),
    ],
)
def test_problems_before_anything_is_read(checkpoint, change, complaint):
    given = [
        *PAIR,
        f"calibration={EXAMPLES / 'calibration.yaml'}",
        f"checkpoint={checkpoint}",
        "output=mug.glb",
    ]
    key = change.partition("=")[0]
    overrides = [override for override in given if not override.startswith(f"{key}=")] + [change]
    (problem,) = find_problems("reconstruct", overrides, check_reconstruction)
    assert complaint in problem


@pytest.mark.parametrize(
    ("checkpoint_name", "complaint"),
    [
        ("none", "no such file, nor the name of shipped weights"),
        ("none.ckpt", "no such file, nor the name"),
        ("none.safetensors", "cannot be read .* exported weights are two files"),
    ],
)
def test_no_checkpoints(checkpoint_name, complaint, tmp_path):
    with pytest.raises(UserError, match=complaint) as raised:
        reconstruct(checkpoint_name, tmp_path / "mug.glb")
    assert single_line(str(raised.value))
    assert not list(tmp_path.iterdir())


def test_an_output_that_cannot_be_written(checkpoint, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="cannot be written"):
        reconstruct(checkpoint, tmp_path / "file" / "mug.glb", "preview=false")


def test_simplified_meshes_stay_closed_with_fewer_faces(checkpoint, tmp_path):
    whole = reconstruct(checkpoint, tmp_path / "a.ply", "resolution=32").mesh
    simple = reconstruct(checkpoint, tmp_path / "b.ply", "resolution=32", "simplify=0.001").mesh
    assert simple.is_watertight
    assert len(simple.faces) < 0.7 * len(whole.faces)


def test_exported_weights_answer_as_their_checkpoint(checkpoint, tmp_path):
    written = export(
        compose_config(
            "export", [f"checkpoint='{checkpoint}'", f"output='{tmp_path / 'tiny.v1'}'", "half=false"]
        )
    )
    assert [path.name for path in written] == ["tiny.v1.safetensors", "tiny.v1.json", "tiny.v1.md"]
    original = reconstruct(checkpoint, tmp_path / "a.ply").mesh
    for name in (tmp_path / "tiny.v1.safetensors", tmp_path / "tiny.v1"):
        np.testing.assert_array_equal(reconstruct(name, tmp_path / "b.ply").mesh.vertices, original.vertices)
    assert load_trained(str(tmp_path / "tiny.v1")).decision.threshold == pytest.approx(0.4)
    card = (tmp_path / "tiny.v1.md").read_text()
    steps = load_trained(str(tmp_path / "tiny.v1")).config.steps
    assert f"7 of {steps} steps on mug, bowl, bottle" in card
    assert "Not evaluated." in card


def test_half_precision_is_half_the_size(checkpoint, tmp_path):
    sizes = []
    for half in ("false", "true"):
        output = tmp_path / half
        export(compose_config("export", [f"checkpoint='{checkpoint}'", f"output='{output}'", f"half={half}"]))
        sizes.append(output.with_suffix(".safetensors").stat().st_size)
    assert sizes[1] < 0.65 * sizes[0]
    near = load_trained(str(tmp_path / "true")).model.state_dict()
    for name, tensor in load_trained(str(checkpoint)).model.state_dict().items():
        torch.testing.assert_close(near[name], tensor, rtol=1e-3, atol=1e-6)


def test_the_card_has_the_metrics_and_the_command(checkpoint, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    shutil.copy(checkpoint, run / "best.ckpt")
    history = [
        {"step": step, "val/iou": iou} for step, iou in ((6, 0.9), (7, 0.5))
    ]  # the checkpoint is of step 7
    (run / "metrics.json").write_text(json.dumps({"best": history[0], "history": history}))
    (run / "overrides.yaml").write_text("- model=stereo\n- steps=12\n")
    export(compose_config("export", [f"checkpoint='{run / 'best.ckpt'}'", f"output='{tmp_path / 'x'}'"]))
    card = (tmp_path / "x.md").read_text()
    assert "| `iou` | 0.5 |" in card
    assert "python -m stereo_occ.train model=stereo steps=12" in card


def test_exporting_again_takes_the_metrics_that_came_with_the_weights(checkpoint, tmp_path, monkeypatch):
    """Not those of a run in the working directory."""
    (tmp_path / "evaluation.json").write_text(json.dumps({"metrics": {"test/iou": 0.7}}))
    given = [f"checkpoint='{checkpoint}'", f"metrics='{tmp_path / 'evaluation.json'}'"]
    export(compose_config("export", [*given, f"output='{tmp_path / 'x'}'"]))
    (tmp_path / "metrics.json").write_text(json.dumps({"best": {"step": 7, "val/iou": 0.1}, "history": []}))
    (tmp_path / "overrides.yaml").write_text("- model=stereo\n")
    monkeypatch.chdir(tmp_path)
    export(compose_config("export", ["checkpoint=x", "output=again"]))
    assert json.loads(Path("again.json").read_text())["metrics"] == {"test/iou": 0.7}
    assert "stereo_occ.train" not in Path("again.md").read_text()


def test_weights_without_their_description(checkpoint, tmp_path):
    export(compose_config("export", [f"checkpoint='{checkpoint}'", f"output='{tmp_path / 'x'}'"]))
    (tmp_path / "x.json").unlink()
    with pytest.raises(UserError, match=r"x\.json cannot be read .* two files, x.safetensors and x.json"):
        load_trained(str(tmp_path / "x.safetensors"))


def test_the_output_of_an_export_has_no_suffix():
    (problem,) = find_problems("export", ["checkpoint=x", "output=x.safetensors"], check_export)
    assert "must be a path without a suffix" in problem


def test_onnx_that_was_not_exported_says_how(checkpoint, tmp_path):
    pytest.importorskip("onnxruntime")
    with pytest.raises(
        UserError, match=r"backend=onnx needs .*best.ckpt_encoder.onnx; write it with python -m"
    ):
        Reconstructor.from_checkpoint(checkpoint, "onnx")
