"""The same run in every logger: its numbers, its settings, what can be shown, and one log however often it stops."""

import csv
import json
import sqlite3
import struct
import time

import pytest
import yaml
from runs import program
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from test_training import INTERVAL, STEPS, stopped

from stereo_occ.checks.training import check_training
from stereo_occ.problems import find_problems

EVERY_STEP = list(range(1, STEPS + 1))


def true_curves(run):
    """Step and value of the curves that every logger must have."""
    events = EventAccumulator(str(run / "tensorboard"))
    events.Reload()
    return {
        name: [(event.step, pytest.approx(event.value, rel=1e-6)) for event in events.Scalars(name)]
        for name in ("train/loss", "lr-Adam", "val/iou", "val/loss", "val/threshold")
    }


def csv_curves(folder):
    with (folder / "curves.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = set(rows[0]) - {"step"}
    return {name: [(int(row["step"]), float(row[name])) for row in rows if row[name]] for name in names}


def wandb_parts(folder):
    """The records of each part of a run, when its last one has been written by wandb's own process."""
    for part in sorted((folder / "wandb").glob("offline-run-*")):
        path = next(part.glob("*.wandb"))
        for _ in range(300):
            records = list(wandb_records(path.read_bytes()))
            if any(record.HasField("exit") for record in records):
                break
            time.sleep(0.1)
        yield records


def wandb_records(data):
    """Of a LevelDB log behind a header of 7 bytes: in blocks of 32 KiB, perhaps in pieces."""
    from wandb.proto.wandb_internal_pb2 import Record

    at, pieces = 7, b""
    while at + 7 <= len(data):
        left = 32768 - at % 32768
        if left < 7:
            at += left
            continue
        _, size, kind = struct.unpack("<IHB", data[at : at + 7])
        pieces += data[at + 7 : at + 7 + size]
        at += 7 + size
        if kind in (1, 4):  # whole, or the last piece
            yield Record.FromString(pieces)
            pieces = b""


def wandb_curves(folder):
    curves = {}
    for records in wandb_parts(folder):
        for record in records:
            if record.WhichOneof("record_type") == "history":
                values = {
                    item.key or "/".join(item.nested_key): json.loads(item.value_json)
                    for item in record.history.item
                }
                for name, value in values.items():
                    curves.setdefault(name, []).append((values["_step"], value))
    return curves


def mlflow_tables(root):
    with sqlite3.connect(root / "mlflow.db") as base:
        runs = base.execute("select run_uuid, name, status from runs").fetchall()
        metrics = base.execute("select run_uuid, key, step, value from metrics order by step").fetchall()
        params = base.execute("select run_uuid, key, value from params").fetchall()
    base.close()
    return runs, metrics, params


def mlflow_curves(root, run_id):
    curves = {}
    for run, name, step, value in mlflow_tables(root)[1]:
        if run == run_id:
            curves.setdefault(name, []).append((step, value))
    return curves


def test_csv_has_the_curves_and_the_settings(workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run", "logger=csv")
    logged = csv_curves(folder)
    assert {name: logged[name] for name in true_curves(run)} == true_curves(run)
    assert "epoch" not in logged
    settings = yaml.safe_load((folder / "settings.yaml").read_text())
    assert (settings["model.encoder.name"], settings["optimizer.lr"], settings["seed"]) == (
        "dilated_resnet",
        0.01,
        0,
    )
    assert not (folder / "tensorboard").exists()


@pytest.mark.parametrize("step", [2, 7])
def test_csv_of_a_stopped_run_is_that_of_one_that_was_not(workshop, run, tmp_path, monkeypatch, step):
    folder = stopped(workshop, monkeypatch, tmp_path / "run", step, "logger=csv")
    before = csv_curves(folder)["train/loss"]
    assert before == true_curves(run)["train/loss"][: len(before)]
    workshop.train(folder, "logger=csv")
    logged = csv_curves(folder)
    assert {name: logged[name] for name in true_curves(run)} == true_curves(run)


def test_csv_starts_over_with_the_run(workshop, tmp_path):
    folder = workshop.train(tmp_path / "run", "logger=csv", "steps=6", "seed=5")
    workshop.train(folder, "logger=csv", "resume=never", "steps=6")
    assert [step for step, _ in csv_curves(folder)["train/loss"]] == EVERY_STEP[:6]


def test_several_loggers_at_once(workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run", "logger.csv=true")
    assert (
        csv_curves(folder)["train/loss"]
        == true_curves(run)["train/loss"]
        == true_curves(folder)["train/loss"]
    )


def test_curves_and_meshes_are_pictures_in_tensorboard(run):
    events = EventAccumulator(str(run / "tensorboard"))
    events.Reload()
    curves = events.Images("val/curves")
    assert [event.step for event in curves] == [INTERVAL, STEPS]
    assert (curves[0].width, curves[0].height) == (640, 300)


@pytest.fixture(scope="module")
def wandb():
    return pytest.importorskip("wandb")


def test_wandb_has_the_curves_the_settings_the_pictures_and_the_meshes(wandb, workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run", "logger=wandb", "logger.examples=1")
    logged = wandb_curves(folder)
    assert {name: logged[name] for name in true_curves(run)} == true_curves(run)
    (records,) = wandb_parts(folder)
    begun = next(record.run for record in records if record.HasField("run"))
    assert (begun.project, begun.display_name) == ("stereo-occ", "run")
    settings = {
        item.key or "/".join(item.nested_key): item.value_json
        for record in records
        if record.HasField("config")
        for item in record.config.update
    }
    assert settings["model.encoder.name"] == '"dilated_resnet"'
    files = [
        path.name for path in (folder / "wandb").glob("offline-run-*/files/media/**/*") if path.is_file()
    ]
    assert len([name for name in files if name.startswith("left_right") or ".png" in name]) == 3 + 2
    assert len([name for name in files if name.endswith(".glb")]) >= 3
    assert [record.exit.exit_code for record in records if record.HasField("exit")] == [0]
    assert wandb.run is None


def test_wandb_of_a_stopped_run_goes_on_with_the_same_id(wandb, workshop, run, tmp_path, monkeypatch):
    """Every point is sent once, though the steps since the last checkpoint are run twice."""
    folder = stopped(workshop, monkeypatch, tmp_path / "run", 8, "logger=wandb")
    workshop.train(folder, "logger=wandb")
    logged = wandb_curves(folder)
    assert {name: logged[name] for name in true_curves(run)} == true_curves(run)
    workshop.train(folder, "logger=wandb", "resume=never", "steps=6")
    first, second, third = (
        next(record.run.run_id for record in records if record.HasField("run"))
        for records in wandb_parts(folder)
    )
    assert first == second != third


@pytest.fixture(scope="module")
def mlflow():
    pytest.importorskip("sqlalchemy")
    return pytest.importorskip("mlflow")


@pytest.mark.filterwarnings("ignore:The ``noload`` loader strategy is deprecated")
def test_mlflow_has_all_of_every_run_and_goes_on_with_a_stopped_one(
    mlflow, workshop, run, tmp_path, monkeypatch
):
    overrides = ["logger=mlflow", f"paths.outputs={tmp_path}"]
    folder = stopped(workshop, monkeypatch, tmp_path / "first", 8, *overrides)
    ((run_id, name, status),), *_ = mlflow_tables(tmp_path)
    assert (name, status) == ("first", "FAILED")
    workshop.train(folder, *overrides)
    runs, _, params = mlflow_tables(tmp_path)
    assert runs == [(run_id, "first", "FINISHED")]
    logged = mlflow_curves(tmp_path, run_id)
    assert {name: logged[name] for name in true_curves(run)} == true_curves(run)
    assert {key: value for _, key, value in params}["model.encoder.name"] == "dilated_resnet"
    (artifacts,) = (tmp_path / "mlflow").glob("*/artifacts")
    assert {path.name for path in (artifacts / "val" / "curves").iterdir()} == {
        "step_000006.png",
        "step_000012.png",
    }
    assert len(list(artifacts.glob("example/*/true"))) == 3
    workshop.train(tmp_path / "second", *overrides, "seed=1", "steps=6")
    assert [name for _, name, _ in mlflow_tables(tmp_path)[0]] == ["first", "second"]


def test_a_sweep_has_a_log_of_each_run(workshop, tmp_path):
    overrides = workshop.overrides("logger=csv", "steps=2", "validation.interval=2")
    done = program(
        "-m", "stereo_occ.train", "-m", *overrides, "seed=0,1", "hydra.sweep.dir=sweep", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    losses = [
        [value for _, value in csv_curves(tmp_path / "sweep" / f"{seed}_stereo_seed{seed}")["train/loss"]]
        for seed in (0, 1)
    ]
    assert [len(values) for values in losses] == [2, 2]
    assert losses[0] != losses[1]


@pytest.mark.parametrize("extra", ["wandb", "mlflow"])
def test_a_logger_that_is_not_installed_is_one_line(monkeypatch, extra):
    monkeypatch.setattr("stereo_occ.loggers.config.PACKAGES", {extra: ("no_such_package",)})
    assert find_problems("train", [f"logger={extra}"], check_training) == [
        f"logger.{extra}: needs the package no_such_package; pip install 'stereo-occ[{extra}]'"
    ]
