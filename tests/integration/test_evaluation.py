"""Evaluation: the same numbers as in training, other objects, and what cannot be evaluated."""

import csv
import json
import shutil
from itertools import product

import numpy as np
import pytest
import torch
import trimesh
from PIL import Image
from runs import program
from samples import single_line

from stereo_occ import compare
from stereo_occ.checkpoint import KEY, read_checkpoint
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.evaluate import evaluate
from stereo_occ.export import export
from stereo_occ.train import train


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def evaluation(workshop, run, tmp_path_factory):
    """The evaluation of the best checkpoint on the validation objects: its folder and metrics."""
    folder = tmp_path_factory.mktemp("evaluation")
    return folder, workshop.evaluate(run / "best.ckpt", folder, "subset=val")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """Two usable mugs, a usable bowl, a bottle that is a flat sheet, and a folder that is no category."""
    root = tmp_path_factory.mktemp("meshes")
    for name, extents in (("mug/tall", (1, 2, 1)), ("mug/wide", (3, 1, 1)), ("bowl/flat", (2, 1, 2))):
        (root / name).mkdir(parents=True)
        trimesh.creation.box(extents=extents).export(root / name / "model.obj")
    (root / "bottle" / "sheet").mkdir(parents=True)
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    sheet.export(root / "bottle" / "sheet" / "model.obj")
    (root / "vase" / "x").mkdir(parents=True)
    return root


def test_evaluating_repeats_the_validation_of_the_training(run, evaluation):
    _, metrics = evaluation
    best = json.loads((run / "metrics.json").read_text())["best"]
    expected = {name.removeprefix("val/"): value for name, value in best.items() if name.startswith("val/")}
    measured = {name: metrics[f"test/{name}"] for name in expected}
    assert measured == pytest.approx(expected, abs=1e-6)


def test_a_twin_is_evaluated_under_its_control(workshop, tmp_path):
    twin = workshop.train(tmp_path / "run", "logger=none", "control=right_zeroed")
    best = json.loads((twin / "metrics.json").read_text())["best"]
    measured = workshop.evaluate(twin / "best.ckpt", tmp_path / "own", "subset=val")
    for name in ("iou", "iou_bbox"):
        assert measured[f"test/{name}"] == pytest.approx(best[f"val/{name}"], abs=1e-6)
    assert json.loads((tmp_path / "own" / "metrics.json").read_text())["control"]["name"] == "right_zeroed"
    with Image.open(next((tmp_path / "own").glob("pictures/*/*.png"))) as picture:
        panels = np.array_split(np.asarray(picture), 4, axis=1)
    assert (panels[0].max(), panels[1].max()) == (255, 0)
    pairs = workshop.evaluate(
        twin / "best.ckpt", tmp_path / "none", "subset=val", "control=none", "examples=0"
    )
    assert pairs["test/brier"] != pytest.approx(measured["test/brier"], abs=1e-6)


def test_a_pairs_own_threshold_is_the_same_in_training_and_evaluation(workshop, tmp_path):
    run = workshop.train(tmp_path / "run", "logger=none", "validation.decision=relative")
    best = json.loads((run / "metrics.json").read_text())["best"]
    measured = workshop.evaluate(run / "best.ckpt", tmp_path / "out", "subset=val")
    for name in ("iou", "iou/mug", "iou_bbox"):
        assert measured[f"test/{name}"] == pytest.approx(best[f"val/{name}"], abs=1e-6)
    results = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert results["decision"] == {"rule": "relative", "threshold": pytest.approx(best["val/threshold"])}
    assert 0 < results["threshold"] < results["decision"]["threshold"]  # no IoU that is expected is 1


def test_results_are_files(run, evaluation):
    folder, metrics = evaluation
    results = json.loads((folder / "metrics.json").read_text())
    assert results["metrics"] == metrics
    assert results["threshold"] == pytest.approx(
        json.loads((run / "metrics.json").read_text())["threshold"], abs=1e-6
    )
    assert (results["subset"], results["objects"], results["views"]) == ("val", 3, 2)
    table = rows(folder / "per_object.csv")
    assert [(row["category"], row["view"]) for row in table] == list(product(("bottle", "bowl", "mug"), "01"))
    for category in ("bottle", "bowl", "mug"):
        values = [float(row["iou"]) for row in table if row["category"] == category]
        assert np.mean(values) == pytest.approx(metrics[f"test/iou/{category}"], abs=1e-6)
    assert {row["failure"] for row in table} == {""}
    assert not (folder / "skipped.csv").exists()


def test_example_meshes_and_pictures(evaluation):
    folder, _ = evaluation
    truths = sorted(folder.glob("meshes/*/*_true.glb"))
    assert [path.parent.name for path in truths] == ["bottle", "bowl", "mug"]
    for path in truths:
        mesh = trimesh.load_mesh(path)
        assert mesh.is_volume
        assert np.abs(mesh.bounds).max() <= 0.5 + 1e-6  # posed, in the rig frame
    for path in folder.glob("pictures/*/*.png"):
        with Image.open(path) as picture:
            assert picture.size == (4 * 192, 192)
    assert len(list(folder.glob("pictures/*/*.png"))) == 3


def test_the_stored_threshold_decides(workshop, run, tmp_path):
    """Another threshold in the checkpoint gives other numbers, and those of 0.5 stay."""
    checkpoint = read_checkpoint(run / "best.ckpt")
    results = {}
    for threshold in (0.05, 0.5, 0.95):
        checkpoint["state_dict"]["threshold"] = torch.tensor(threshold)
        torch.save(checkpoint, tmp_path / "best.ckpt")
        results[threshold] = workshop.evaluate(tmp_path / "best.ckpt", tmp_path / "out", "examples=0")
    assert results[0.5]["test/iou"] == pytest.approx(results[0.5]["test/iou_at_0.5"])
    assert results[0.05]["test/iou"] != results[0.95]["test/iou"]
    assert len({metrics["test/iou_at_0.5"] for metrics in results.values()}) == 1


def test_an_example_that_has_become_empty_leaves_no_mesh(workshop, run, tmp_path):
    checkpoint = read_checkpoint(run / "best.ckpt")
    meshes = {}
    for threshold in (0.01, 0.9999):
        checkpoint["state_dict"]["threshold"] = torch.tensor(threshold)
        torch.save(checkpoint, tmp_path / "best.ckpt")
        workshop.evaluate(tmp_path / "best.ckpt", tmp_path / "out")
        meshes[threshold] = len(list((tmp_path / "out").glob("meshes/*/*_predicted.glb")))
    assert meshes == {0.01: 3, 0.9999: 0}


def test_batches_do_not_change_the_result(workshop, run, tmp_path, evaluation):
    one_by_one = workshop.evaluate(run / "best.ckpt", tmp_path, "subset=val", "batch_size=1", "examples=0")
    assert one_by_one == pytest.approx(
        evaluation[1], abs=2e-3
    )  # a logit at the threshold may round either way


def test_a_folder_of_meshes(workshop, run, meshes, tmp_path):
    metrics = workshop.evaluate(
        run / "best.ckpt", tmp_path, "data=meshes", f"data.root={meshes}", "data.pool_size=1000"
    )
    results = json.loads((tmp_path / "metrics.json").read_text())
    assert (results["subset"], results["objects"], results["skipped"]) == ("all", 3, 2)
    assert [row["object_id"] for row in rows(tmp_path / "per_object.csv")[::2]] == ["flat", "tall", "wide"]
    reasons = {row["category"]: row["reason"] for row in rows(tmp_path / "skipped.csv")}
    assert reasons["bottle"].startswith("encloses no volume")
    assert "not a category" in reasons["vase"]
    assert set(metrics) >= {"test/iou", "test/iou/mug", "test/iou/bowl"}
    assert "test/iou/bottle" not in metrics
    assert "meshes_32px" in results["data"]  # the checkpoint's image side, as many views as asked


def test_other_objects_scenes_and_cameras(workshop, run, tmp_path):
    overrides = ["data=procedural", "data.seed=7", "data.pool_size=1000", "categories=mug", "subset=all"]
    scenes = ["placement=free", "lights=random", "material=varied", "background=uniform", "rig=paper"]
    metrics = workshop.evaluate(
        run / "best.ckpt", tmp_path, *overrides, *scenes, "rig.fov_deg=65", "examples=0", "views=1"
    )
    assert 0 <= metrics["test/iou/mug"] <= 1
    assert len(rows(tmp_path / "per_object.csv")) == 3


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        (["views=3"], "views=3: there are only 2 of each object in test; ask for fewer"),
        (["points=5000"], "5000 asked from a pool of 2000"),
        (["rig=paper", "rig.fov_deg=190"], "rig.fov_deg=190.0: must be 1 to 170"),
        (["data=meshes", "data.root=/nowhere"], "data.root=/nowhere: no such folder"),
        (["categories=mug", "categories.names=[cup]"], "categories.names=cup: unknown"),
    ],
)
def test_what_the_checkpoints_data_cannot_give(workshop, run, tmp_path, overrides, complaint):
    with pytest.raises(UserError) as refusal:
        workshop.evaluate(run / "best.ckpt", tmp_path, *overrides)
    assert complaint in str(refusal.value)
    assert single_line(str(refusal.value))


@pytest.fixture(scope="module")
def own_meshes(workshop, tmp_path_factory):
    """A folder of four mugs, the command line that asks for it, and a run trained on it."""
    folder = tmp_path_factory.mktemp("own")
    for width in (1, 2, 3, 4):
        mug(folder / "meshes", width)
    overrides = ["data=meshes", f"data.root={folder / 'meshes'}", "data.pool_size=1000", "categories=mug"]
    return (
        folder / "meshes",
        overrides,
        workshop.train(folder / "run", *overrides, "logger=none", "data.views=2"),
    )


def mug(root, width):
    """A file of its own for each width."""
    (root / "mug" / f"wide_{width}").mkdir(parents=True)
    trimesh.creation.box(extents=(width, 2, 1)).export(root / "mug" / f"wide_{width}" / "model.obj")


def test_objects_of_the_training_are_not_called_new(workshop, own_meshes, tmp_path):
    """One more mesh, and the data set is divided another way."""
    root, _, run = own_meshes
    workshop.evaluate(run / "best.ckpt", tmp_path / "before", "examples=0")
    grown = shutil.copytree(root, tmp_path / "grown")
    mug(grown, 5)
    elsewhere = ["data=meshes", f"data.root={grown}", "data.pool_size=1000", "categories=mug", "examples=0"]
    refused = (
        r"subset=auto: 3 of the 5 objects were in the model's training or validation \(mug/wide_\d is one"
    )
    with pytest.raises(UserError, match=refused):
        workshop.evaluate(run / "best.ckpt", tmp_path / "grown_out", *elsewhere)
    assert not (tmp_path / "grown_out").exists()
    workshop.evaluate(run / "best.ckpt", tmp_path / "all", *elsewhere, "subset=all")
    export(compose_config("export", [f"checkpoint='{run / 'best.ckpt'}'", f"output='{tmp_path / 'w'}'"]))
    with pytest.raises(UserError, match=refused):
        workshop.evaluate(tmp_path / "w.safetensors", tmp_path / "grown_out", *elsewhere)
    assert len(rows(tmp_path / "all" / "per_object.csv")) == 10


def test_a_training_on_other_objects_does_not_go_on(workshop, own_meshes, tmp_path):
    root, overrides, run = own_meshes
    kept = {path.name: path.read_bytes() for path in run.iterdir() if path.is_file()}
    renamed = (root / "mug" / "wide_1").rename(tmp_path / "wide_1")
    mug(root, 6)
    try:
        with pytest.raises(UserError, match=r"holds a run with other training or validation objects"):
            workshop.train(run, *overrides, "logger=none", "data.views=2", "steps=50")
    finally:
        shutil.rmtree(root / "mug" / "wide_6")
        renamed.rename(root / "mug" / "wide_1")
    assert {path.name: path.read_bytes() for path in run.iterdir() if path.is_file()} == kept


@pytest.mark.parametrize("noted", [True, False])
def test_another_division_of_generated_objects_makes_none_of_them_new(workshop, run, tmp_path, noted):
    """Also of a checkpoint that does not note its objects: its settings say them."""
    checkpoint = read_checkpoint(run / "best.ckpt")
    if not noted:
        del checkpoint[KEY]["objects"]
    torch.save(checkpoint, tmp_path / "best.ckpt")
    more = ["data=procedural", "data.fractions=[0,0,1]", "data.pool_size=1000", "data.views=2"]
    with pytest.raises(UserError, match=r"subset=test: 6 of the 9 objects were in the model's training"):
        workshop.evaluate(tmp_path / "best.ckpt", tmp_path / "out", *more, "subset=test", "examples=0")
    workshop.evaluate(
        tmp_path / "best.ckpt", tmp_path / "new", *more, "data.seed=7", "subset=test", "examples=0"
    )


def test_a_folder_without_a_solid(workshop, run, meshes, tmp_path):
    shutil.copytree(meshes / "bottle", tmp_path / "only" / "bottle")
    with pytest.raises(UserError, match=r"no usable object of mug, bowl, bottle; .*inspect"):
        workshop.evaluate(run / "best.ckpt", tmp_path, "data=meshes", f"data.root={tmp_path / 'only'}")


def test_a_configuration_of_another_version(workshop, run, tmp_path):
    checkpoint = read_checkpoint(run / "best.ckpt")
    checkpoint[KEY]["config"]["colour"] = "red"
    torch.save(checkpoint, tmp_path / "best.ckpt")
    with pytest.raises(UserError, match="written by another version"):
        workshop.evaluate(tmp_path / "best.ckpt", tmp_path / "out")


def test_pretrained_weights_are_not_fetched_for_a_checkpoint(workshop, tmp_path):
    """A model that began with ImageNet weights is evaluated where they are not to be had."""
    mono = ["model=mono", "model.encoder.weights=null", "model.code_size=8", "model.decoder.hidden=8"]
    common = [o for o in workshop.overrides() if not o.startswith("model.")]
    train(
        compose_config("train", [*common, *mono, "steps=1", "validation.interval=1", "logger=none"]),
        tmp_path / "run",
    )
    checkpoint = read_checkpoint(tmp_path / "run" / "best.ckpt")
    checkpoint[KEY]["config"]["model"]["encoder"]["weights"] = "IMAGENET1K_V1"
    torch.save(checkpoint, tmp_path / "best.ckpt")
    assert "test/iou" in workshop.evaluate(tmp_path / "best.ckpt", tmp_path / "out", "examples=0")


def test_the_command(workshop, run, tmp_path):
    (tmp_path / "bad.ckpt").write_bytes(b"half of it")
    refused = program("-m", "stereo_occ.evaluate", "checkpoint=bad.ckpt", cwd=tmp_path)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line.startswith("stereo_occ: checkpoint=bad.ckpt: is damaged, or holds more")
    arguments = [
        f"checkpoint={run / 'best.ckpt'}",
        f"paths.data={workshop.root / 'data'}",
        "hydra.run.dir=out",
    ]
    settings = ["views=2", "points=500", "meshes=0", "examples=0", "progress=false"]
    done = program("-m", "stereo_occ.evaluate", *arguments, *settings, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "test/iou " in done.stdout + done.stderr
    assert (tmp_path / "out" / "metrics.json").is_file()


@pytest.mark.parametrize("baseline", ["visual_hull", "sgm", "mean_shape", "nearest_shape", "truth"])
def test_a_baseline_is_measured_like_a_network(workshop, run, tmp_path, evaluation, baseline):
    """On the same object-views, with every metric, and comparable with it."""
    if baseline == "sgm":
        pytest.importorskip("cv2")
    small = ["meshes=1", "surface_points=500", "mesh_resolution=32", "examples=0"]
    overrides = [f"baseline={baseline}", "subset=val", *small]
    metrics = workshop.evaluate(run / "best.ckpt", tmp_path / "baseline", *overrides)
    workshop.evaluate(run / "best.ckpt", tmp_path / "network", "subset=val", *small)
    tables = [rows(tmp_path / name / "per_object.csv") for name in ("baseline", "network")]
    assert [list(row) for row in tables[0]] == [list(row) for row in tables[1]]
    keys = [[(row["category"], row["object_id"], row["view"]) for row in table] for table in tables]
    assert keys[0] == keys[1]
    assert [row["mesh_iou"] != "" for row in tables[0]] == [True, False] * 3
    assert set(metrics) >= {"test/iou/mug", "test/mesh_iou", "test/chamfer_l1", "test/cavity_empty/bowl"}
    compare.main(
        [*(str(tmp_path / name) for name in ("network", "baseline")), "--output", str(tmp_path / "out")]
    )
    compared = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert compared["notes"] == []
    assert compared["results"]["iou"]["macro"]["b"] == pytest.approx(metrics["test/iou"])


@pytest.mark.parametrize("baseline", ["nearest_shape", "truth"])
def test_a_perfect_answer(workshop, run, tmp_path, baseline):
    """The nearest training shape of a training object is itself."""
    metrics = workshop.evaluate(
        run / "best.ckpt", tmp_path, f"baseline={baseline}", "subset=train",
        "meshes=1", "surface_points=30000", "examples=0",
    )  # fmt: skip
    for name in ("iou", "iou_bbox", "mesh_iou", "f_score_2", "cavity_empty"):
        assert metrics[f"test/{name}"] == pytest.approx(1, abs=2e-3), name
    assert metrics["test/iou_unrotated"] < 0.9


def test_a_baseline_needs_no_checkpoint(workshop, tmp_path):
    """The training data may be named by overrides of train instead."""
    data = [o for o in workshop.overrides() if o.startswith(("data.", "scale.", "workers"))]
    cfg = compose_config(
        "evaluate",
        [
            "baseline=visual_hull", f"training={data}", f"paths.data={workshop.root / 'data'}",
            "progress=false", "workers=1", "views=2", "points=500", "meshes=0", "examples=0",
        ],
    )  # fmt: skip
    metrics = evaluate(cfg, tmp_path)
    results = json.loads((tmp_path / "metrics.json").read_text())
    arguments = [f"training={data}", f"paths.data={workshop.root / 'data'}", "hydra.run.dir=out", "workers=1"]
    small = ["progress=false", "views=2", "points=500", "meshes=0", "examples=0"]
    done = program("-m", "stereo_occ.evaluate", "baseline=visual_hull", *arguments, *small, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["metrics"] == results["metrics"]
    assert results["predictor"] == {"baseline": {"name": "visual_hull"}}
    assert (results["objects"], results["parameters"]) == (3, None)
    assert 0 < metrics["test/iou"] < 1


def test_an_empty_prediction_is_counted(workshop, run, tmp_path):
    """A threshold that nothing reaches: no mesh, IoU 0, the worst distance, and the number of failures."""
    checkpoint = read_checkpoint(run / "best.ckpt")
    checkpoint["state_dict"]["threshold"] = torch.tensor(1 - 1e-6)
    torch.save(checkpoint, tmp_path / "best.ckpt")
    metrics = workshop.evaluate(
        tmp_path / "best.ckpt", tmp_path / "out", "meshes=1", "surface_points=500", "examples=0"
    )
    results = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert results["failures"] == {"empty mesh": 3}
    assert metrics["test/chamfer_l1"] == pytest.approx(3**0.5)
    assert (metrics["test/iou"], metrics["test/mesh_iou"], metrics["test/f_score_1"]) == (0, 0, 0)
    assert {row["failure"] for row in rows(tmp_path / "out" / "per_object.csv")} == {"", "empty mesh"}


def test_the_same_command_gives_the_same_numbers(workshop, run, tmp_path, evaluation):
    again = workshop.evaluate(run / "best.ckpt", tmp_path, "subset=val")
    assert again == evaluation[1]
