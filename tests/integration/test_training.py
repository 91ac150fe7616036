"""Runs: the schedule asked for is the schedule run, whatever interrupts it."""

import json
import signal
import time

import h5py
import pytest
import torch
from lightning.pytorch import Callback
from lightning.pytorch.utilities.exceptions import SIGTERMException
from runs import Workshop, program
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from stereo_occ import resume
from stereo_occ import train as train_module
from stereo_occ.checkpoint import KEY, plain, read_checkpoint
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.metrics.scores import Scores

STEPS, INTERVAL, SAVES = 12, 6, 3


def history(folder):
    return json.loads((folder / "metrics.json").read_text())["history"]


def weights(folder, name="last.ckpt"):
    return torch.load(folder / name, weights_only=True)["state_dict"]


def same_weights(first, second, name="last.ckpt"):
    a, b = weights(first, name), weights(second, name)
    return a.keys() == b.keys() and all(torch.equal(a[key], b[key]) for key in a)


def curves(folder):
    events = EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    return {tag: [event.step for event in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


class StopAt(Callback):
    """Ends the run after a step, as a user, a scheduler or a crash would."""

    def __init__(self, step, reason):
        self.step, self.reason = step, reason

    def on_train_batch_end(self, trainer, *_):
        if trainer.global_step == self.step:
            raise self.reason


def stopped(workshop, monkeypatch, folder, step, *overrides, reason=None):
    """Start a run that ends after ``step``."""
    build, on_interrupt = train_module.build_callbacks, signal.getsignal(signal.SIGINT)
    with monkeypatch.context() as patch:
        patch.setattr(
            train_module,
            "build_callbacks",
            lambda *args: [*build(*args), StopAt(step, reason or RuntimeError("stopped"))],
        )
        with pytest.raises((RuntimeError, SystemExit)) as stop:
            workshop.train(folder, *overrides)
    signal.signal(signal.SIGINT, on_interrupt)  # Lightning ignores it from then on
    assert reason is None or stop.value.code in (130, 143)
    assert folder.is_dir()
    # TensorBoard reads event files of one second and process in the order of a number's text, 9 after 10.
    time.sleep(1 - time.time() % 1)
    return folder


def test_validation_is_run_at_every_multiple_of_its_interval_across_data_epochs(run):
    assert [entry["step"] for entry in history(run)] == [6, 12]
    logged = curves(run)
    assert logged["val/iou"] == [6, 12]
    assert logged["val/iou/mug"] == [6, 12]
    assert logged["train/loss"] == list(range(1, STEPS + 1))
    assert logged["lr-Adam"] == list(range(1, STEPS + 1))
    assert "epoch" not in logged


def test_curves_of_losses_follow_the_logging_interval(workshop, tmp_path):
    logged = curves(workshop.train(tmp_path / "run", "logger.interval=5"))
    assert logged["train/loss"] == [5, 10]
    assert logged["val/iou"] == [6, 12]


def test_dashboard_has_pictures_meshes_curves_and_hyper_parameters(run):
    events = EventAccumulator(str(run / "tensorboard"))
    events.Reload()
    tags = events.Tags()
    assert sum(tag.endswith("/left_right") for tag in tags["images"]) == 3
    assert sum(tag.endswith("/true_VERTEX") for tag in tags["tensors"]) == 3
    assert [event.step for event in events.Tensors("val/precision_recall")] == [6, 12]
    hparams = events.PluginTagToContent("hparams")
    assert set(hparams) >= {"_hparams_/experiment", "_hparams_/session_start_info"}
    assert b"val/iou" in hparams["_hparams_/experiment"]
    assert b"model.encoder.name" in hparams["_hparams_/session_start_info"]


def test_the_run_folder(run):
    assert {path.name for path in run.iterdir()} == {
        "best.ckpt",
        "last.ckpt",
        "metrics.json",
        "config.yaml",
        "tensorboard",
    }


def test_metrics_file(run):
    metrics = json.loads((run / "metrics.json").read_text())
    assert metrics.keys() == {
        "schema", "protocol", "stereo_occ", "commit", "dirty", "torch", "python", "packages", "cpu", "threads",
        "parameters", "seconds", "threshold", "best", "history",
    }  # fmt: skip
    best = max(metrics["history"], key=lambda entry: entry["val/iou"])
    assert metrics["best"] == best
    assert metrics["threshold"] == best["val/threshold"]
    assert set(best) >= {"step", "val/loss", "val/iou", "val/iou/mug", "val/iou_bbox", "val/iou_unrotated"}
    trained = [value for name, value in weights(run).items() if name != "threshold" and "running" not in name]
    assert metrics["parameters"] == sum(v.numel() for v in trained if v.dtype.is_floating_point)


def test_best_is_the_state_of_the_best_validation_with_its_threshold(run):
    best = json.loads((run / "metrics.json").read_text())["best"]
    checkpoint = read_checkpoint(run / "best.ckpt")
    assert checkpoint["global_step"] == best["step"]
    assert float(checkpoint["state_dict"]["threshold"]) == best["val/threshold"]
    assert read_checkpoint(run / "last.ckpt")["global_step"] == STEPS


def test_a_checkpoint_holds_its_configuration(run):
    config = read_checkpoint(run / "best.ckpt")[KEY]["config"]
    assert (config["steps"], config["model"]["name"], config["data"]["split"]) == (STEPS, "stereo", "object")


def test_a_run_begins_with_weights_that_are_given(workshop, run, tmp_path):
    short = ["steps=1", "validation.interval=1", "validation.checkpoint_interval=1", "logger=none"]
    begun = workshop.train(tmp_path / "begun", f"init='{run / 'best.ckpt'}'", "optimizer.lr=1e-12", *short)
    given, after = weights(run, "best.ckpt"), weights(begun)
    learnt = [name for name in given if name.startswith("model.") and name.endswith("weight")]
    for name in learnt:
        torch.testing.assert_close(after[name], given[name], atol=1e-9, rtol=0)
    assert len(learnt) > 10
    assert read_checkpoint(begun / "last.ckpt")[KEY]["config"]["init"] == str(run / "best.ckpt")


def test_a_stopped_run_goes_on_from_its_own_weights(workshop, run, tmp_path, monkeypatch):
    init = f"init='{run / 'best.ckpt'}'"
    whole = workshop.train(tmp_path / "whole", init, "logger=none")
    folder = stopped(workshop, monkeypatch, tmp_path / "parts", 7, init, "logger=none")
    assert same_weights(workshop.train(folder, init, "logger=none"), whole)


def test_weights_of_another_model_are_refused(workshop, run, tmp_path):
    with pytest.raises(UserError, match=r"is of another model; say model\.code_size=16, or leave init out"):
        workshop.train(tmp_path / "other", f"init='{run / 'best.ckpt'}'", "model.code_size=8")


def test_weights_for_images_normalised_otherwise_are_refused(workshop, tmp_path):
    common = [
        o for o in workshop.overrides("logger=none") if not o.startswith(("model.width", "model.encoder"))
    ]
    mono = [
        *common,
        "model=mono_scratch",
        "steps=1",
        "validation.interval=1",
        "validation.checkpoint_interval=1",
    ]
    train_module.train(compose_config("train", mono), tmp_path / "scratch")
    init = f"init='{tmp_path / 'scratch' / 'best.ckpt'}'"
    with pytest.raises(UserError, match=r"is of another model; say model\.encoder\.weights=null, or leave"):
        train_module.train(compose_config("train", [*mono, "model=mono", init]), tmp_path / "other")


def test_the_same_seed_gives_the_same_weights_to_the_bit(workshop, run, tmp_path):
    again = workshop.train(tmp_path / "again", "logger=none")
    assert same_weights(run, again)
    assert history(run) == history(again)
    other = workshop.train(tmp_path / "other", "seed=1", "logger=none")
    assert not same_weights(run, other)


@pytest.mark.parametrize("step", [2, 5, 6, 7, 10])
def test_a_stopped_run_goes_on_as_if_it_had_not_been(workshop, run, tmp_path, monkeypatch, step):
    """Stopped before anything is saved, between savings, at a validation before and after it is saved."""
    folder = stopped(workshop, monkeypatch, tmp_path / "run", step)
    saved = SAVES * (step // SAVES) - (SAVES if step == INTERVAL else 0)  # at a validation: saved after it
    if saved:
        assert read_checkpoint(folder / "last.ckpt")["global_step"] == saved
    workshop.train(folder)
    assert same_weights(run, folder)
    assert same_weights(run, folder, "best.ckpt")
    assert history(run) == history(folder)
    logged = curves(folder)
    assert logged["val/iou"] == [6, 12]
    assert logged["train/loss"] == list(range(1, STEPS + 1))


#: Every training aid at once, on a small model that reads the cameras.
AIDS = [
    "model=pixel_stereo", "model/encoder=light", "model.encoder.channels=8", "model.encoder.widths=[8,8,8,8]",
    "model.encoder.blocks=[1,1,1,1]", "model.groups=2", "model.code_size=8", "model.hidden=8", "model.blocks=1",
    "control=right_shuffled", "augmentation=full", "auxiliary=mask_depth", "averaging=ema", "logger=none",
]  # fmt: skip


class Aided(Workshop):
    """Runs with every training aid."""

    def overrides(self, *more):
        return [o for o in super().overrides() if not o.startswith("model.")] + AIDS + list(more)


@pytest.fixture(scope="module")
def aided(workshop):
    return Aided(workshop.root)


@pytest.fixture(scope="module")
def aided_run(aided, tmp_path_factory):
    return aided.train(tmp_path_factory.mktemp("aided") / "run")


@pytest.mark.parametrize("step", [4, 6, 7])
def test_a_stopped_run_with_training_aids_goes_on(aided, aided_run, tmp_path, monkeypatch, step):
    folder = stopped(aided, monkeypatch, tmp_path / "run", step)
    aided.train(folder)
    for name in ("last.ckpt", "best.ckpt"):
        assert same_weights(aided_run, folder, name)
    state, again = (read_checkpoint(run / "last.ckpt")[KEY] for run in (aided_run, folder))
    assert all(
        torch.equal(value, again["training_weights"][name])
        for name, value in state["training_weights"].items()
    )
    assert history(aided_run) == history(folder)


def test_training_aids_do_not_depend_on_the_process_that_loads(aided, aided_run, tmp_path):
    assert same_weights(aided_run, aided.train(tmp_path / "run", "trainer.workers=1"))


@pytest.mark.parametrize("aid", ["augmentation=none", "auxiliary=none", "averaging=none", "control=none"])
def test_each_training_aid_makes_another_run(aided, aided_run, tmp_path, aid):
    without = aided.train(tmp_path / "run", aid)
    a, b = weights(aided_run), weights(without)
    assert any(not torch.equal(a[key], b[key]) for key in b if key.startswith("model."))
    assert (aid == "auxiliary=none") == (a.keys() != b.keys())
    with pytest.raises(UserError, match=rf"holds a run with another {aid.partition('=')[0]};"):
        aided.train(without)


def test_checkpoints_hold_the_average_and_beside_it_the_weights_to_go_on_from(aided, aided_run, tmp_path):
    checkpoint = read_checkpoint(aided_run / "last.ckpt")
    training, average = checkpoint[KEY]["training_weights"], checkpoint["state_dict"]
    moved = [name for name, value in training.items() if not torch.equal(value, average[f"model.{name}"])]
    assert any("running_mean" in name for name in moved)
    assert any("decoder" in name for name in moved)
    kept = aided.train(tmp_path / "run", "validation.keep_all=true")
    alone = torch.load(kept / "step_000012.ckpt", weights_only=True)
    assert "training_weights" not in alone[KEY]
    assert all(torch.equal(value, average[name]) for name, value in alone["state_dict"].items())


def test_what_is_evaluated_is_the_average_that_was_validated(aided, aided_run, tmp_path):
    best = json.loads((aided_run / "metrics.json").read_text())["best"]
    measured = aided.evaluate(aided_run / "best.ckpt", tmp_path, "subset=val", "examples=0", "meshes=0")
    assert measured["test/iou"] == pytest.approx(best["val/iou"], abs=1e-6)
    assert measured["test/threshold"] == pytest.approx(best["val/threshold"])
    results = json.loads((tmp_path / "metrics.json").read_text())
    assert results["parameters"] == json.loads((aided_run / "metrics.json").read_text())["parameters"]


def test_a_run_stopped_by_hand_and_by_the_machine(workshop, run, tmp_path, monkeypatch, capsys):
    """Ctrl-C and SIGTERM end with the exit codes of their signals and say how to go on."""
    folder = tmp_path / "run"
    for step, saved, reason in ((4, 3, KeyboardInterrupt()), (8, 6, SIGTERMException())):
        stopped(workshop, monkeypatch, folder, step, reason=reason)
        assert capsys.readouterr().err == (
            f"stereo_occ: stopped after step {step} of 12; the same command with hydra.run.dir={folder} goes on "
            f"from step {saved}\n"
        )
    workshop.train(folder)
    assert same_weights(run, folder)
    assert history(run) == history(folder)


KILLED = """
import os, signal, sys
from pathlib import Path
from lightning.pytorch import Callback
from lightning.pytorch.utilities.exceptions import SIGTERMException
from stereo_occ import train
from stereo_occ.cli import compose_config

class Kill(Callback):
    def on_train_batch_start(self, trainer, *_):
        if trainer.global_step == 7:
            os.kill(os.getpid(), getattr(signal, sys.argv[2]))

build = train.build_callbacks
train.build_callbacks = lambda *args: [*build(*args), Kill()]
train.train(compose_config("train", sys.argv[3:]), Path(sys.argv[1]))
"""


@pytest.mark.parametrize(("name", "code", "step"), [("SIGKILL", -9, 6), ("SIGTERM", 143, 8)])
def test_a_killed_process_goes_on(workshop, run, tmp_path, name, code, step):
    """From the last checkpoint; one that is asked to end saves where it is."""
    folder = tmp_path / "run"
    killed = program("-c", KILLED, folder, name, *workshop.overrides(), cwd=tmp_path)
    assert killed.returncode == code, killed.stderr
    assert read_checkpoint(folder / "last.ckpt")["global_step"] == step
    workshop.train(folder)
    assert same_weights(run, folder)
    assert history(run) == history(folder)
    assert curves(folder)["train/loss"] == list(range(1, STEPS + 1))


def test_a_run_that_was_moved_keeps_its_best_state(workshop, monkeypatch, tmp_path):
    """Its last validation is worse, as it is made here: what a tiny network learns differs between processors."""
    summary, validations = Scores.summary, []

    def worse_each_time(scores, threshold):
        validations.append(threshold)
        return {name: value / 100 ** len(validations) for name, value in summary(scores, threshold).items()}

    monkeypatch.setattr(Scores, "summary", worse_each_time)
    folder = stopped(workshop, monkeypatch, tmp_path / "here", 9, "logger=none")
    moved = folder.rename(tmp_path / "there")
    workshop.train(moved, "logger=none")
    first, last = history(moved)
    assert last["val/iou"] < first["val/iou"]
    assert read_checkpoint(moved / "best.ckpt")["global_step"] == first["step"] == INTERVAL


def test_a_run_does_not_become_shorter(workshop, run):
    with pytest.raises(UserError, match=r"^steps=6: the run in .* has 12 already; ask for as many or more"):
        workshop.train(run, "steps=6")


def test_a_finished_run_is_left_as_it_is(workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run")
    before = {name: (folder / name).read_bytes() for name in ("best.ckpt", "last.ckpt", "metrics.json")}
    workshop.train(folder)
    assert before == {name: (folder / name).read_bytes() for name in before}


def test_a_run_can_be_made_longer(workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run", "logger=none", "steps=6")
    workshop.train(folder, "logger=none")
    assert same_weights(run, folder)
    assert history(run) == history(folder)


def test_starting_over_forgets_the_old_run(workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run", "steps=24", "seed=5")
    workshop.train(folder, "resume=never")
    assert same_weights(run, folder)
    assert history(run) == history(folder)
    assert curves(folder)["val/iou"] == [6, 12]


def test_another_run_in_the_same_folder_is_refused(workshop, run):
    before = (run / "last.ckpt").read_bytes()
    with pytest.raises(UserError, match=r"holds a run with another model, seed.*resume=never"):
        workshop.train(run, "seed=1", "model.width=4")
    assert (run / "last.ckpt").read_bytes() == before


@pytest.mark.parametrize(
    ("override", "name"),
    [("scheduler=cosine", "scheduler"), ("validation.decision=relative", r"validation\.decision")],
)
def test_a_run_does_not_go_on_with_another_schedule_or_rule(workshop, run, override, name):
    with pytest.raises(UserError, match=rf"holds a run with another {name};"):
        workshop.train(run, override)


def test_a_longer_run_is_the_same_run():
    """Its warm-up is longer too."""
    config = plain(compose_config("train", ["scheduler=cosine", "steps=4000"]))
    longer = plain(compose_config("train", ["scheduler=cosine", "steps=8000"]))
    assert config["scheduler"]["warmup"] != longer["scheduler"]["warmup"]
    assert resume._fixed(config) == resume._fixed(longer)


@pytest.mark.parametrize(
    ("interval", "message"),
    [
        (1, "the loss is nan after step 8: the training has diverged; lower"),
        (100, "is not finite after step 9:"),
    ],
)
def test_a_training_that_diverges_stops_and_keeps_what_was_before(
    workshop, tmp_path, monkeypatch, interval, message
):
    class Poison(Callback):
        def on_train_batch_end(self, trainer, pl_module, *_):
            if trainer.global_step == 7:
                torch.nn.init.constant_(next(pl_module.parameters()), float("nan"))

    build = train_module.build_callbacks
    monkeypatch.setattr(train_module, "build_callbacks", lambda *args: [*build(*args), Poison()])
    with pytest.raises(UserError, match=message):
        workshop.train(tmp_path, f"logger.interval={interval}")
    assert torch.load(tmp_path / "last.ckpt", weights_only=True)["global_step"] == 6
    assert all(value.isfinite().all() for value in weights(tmp_path).values())


def test_a_damaged_latest_state_is_one_line(workshop, tmp_path):
    (tmp_path / "last.ckpt").write_bytes(b"half of it")
    with pytest.raises(UserError, match=r"last.ckpt: is damaged"):
        workshop.train(tmp_path)


def test_a_damaged_shard_is_one_line(workshop, run, tmp_path):
    """Damage in one image, found when it is read."""
    overrides = [f"paths.data={tmp_path / 'data'}", "logger=none"]
    workshop.train(tmp_path / "first", *overrides)
    for shard in (tmp_path / "data").rglob("*.h5"):
        with h5py.File(shard, "r") as file:
            offset = file["views/rgb"].id.get_chunk_info(0).byte_offset
        content = bytearray(shard.read_bytes())
        content[offset + 20] ^= 1
        shard.write_bytes(content)
    with pytest.raises(UserError, match=r"\.h5: cannot read the shard .*delete it and render again"):
        workshop.train(tmp_path / "second", *overrides)


@pytest.mark.parametrize(
    "overrides",
    [
        ["model=mono", "model.encoder.weights=null"],
        ["placement=free", "lights=random", "material=varied", "background=uniform", "queries=mixed"],
        ["data.split=view", "data.views=4", "validation.views=1", "optimizer=adamw", "scheduler=cosine"],
        ["trainer.gradient_clip=1", "trainer.precision=bf16-mixed", "optimizer=adamw"],
    ],
    ids=["mono", "varied scenes", "split by view", "clipped gradients"],
)
def test_other_runs_go_through(workshop, tmp_path, overrides):
    common = [o for o in workshop.overrides() if not o.startswith(("model.width", "model.encoder"))]
    schedule = ["steps=2", "validation.interval=2", "logger=none"]
    train_module.train(compose_config("train", [*common, *schedule, *overrides]), tmp_path)
    assert [entry["step"] for entry in history(tmp_path)] == [2]


def test_one_pair_where_the_last_map_is_one_cell_is_one_line(workshop, tmp_path):
    overrides = [
        o for o in workshop.overrides() if not o.startswith(("model.width", "model.encoder", "batch_size"))
    ]
    cfg = compose_config("train", [*overrides, "model=mono", "model.encoder.weights=null", "batch_size=1"])
    with pytest.raises(
        UserError, match=r"^batch_size=1: of images of 32 pixels this model has a last map of one cell"
    ):
        train_module.train(cfg, tmp_path)


def test_loading_in_other_processes_gives_the_same_run(workshop, run, tmp_path):
    folder = workshop.train(tmp_path / "run", "trainer.workers=1", "logger=none")
    assert same_weights(run, folder)


def test_every_validation_can_be_kept(workshop, tmp_path):
    folder = workshop.train(tmp_path / "run", "logger=none", "validation.keep_all=true")
    kept = sorted(path.name for path in folder.glob("step_*.ckpt"))
    assert kept == ["step_000006.ckpt", "step_000012.ckpt"]
    assert read_checkpoint(folder / kept[0])[KEY]["config"]["steps"] == STEPS
    workshop.train(folder, "logger=none", "validation.keep_all=true", "resume=never", "seed=1")
    assert kept == sorted(path.name for path in folder.glob("step_*.ckpt"))
    assert {read_checkpoint(folder / name)[KEY]["config"]["seed"] for name in kept} == {1}


def test_nothing_is_said_on_the_terminal(workshop, tmp_path):
    quiet = program("-m", "stereo_occ.train", *workshop.overrides(), "hydra.run.dir=run", cwd=tmp_path)
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    assert (tmp_path / "run" / "best.ckpt").is_file()
