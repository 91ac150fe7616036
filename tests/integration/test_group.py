"""Two processes train one model as one does."""

import json
import sys

import lightning
import pytest
from omegaconf import OmegaConf

from stereo_occ.checkpoint import build_task, read_checkpoint
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.group import run_in_processes
from stereo_occ.quiet import quiet_libraries
from stereo_occ.train import build_data, train, train_together

TWO = ["trainer=ddp", "logger=none"]


def history(folder):
    return json.loads((folder / "metrics.json").read_text())["history"]


def run(workshop, folder, *overrides):
    cfg = compose_config("train", workshop.overrides(*overrides))
    if cfg.trainer.devices == 1:
        train(cfg, folder)
    else:
        train_together(cfg, folder)


@pytest.fixture(scope="module")
def of_two(workshop, tmp_path_factory):
    """A run of two processes; its validation has two batches, one of them half as large."""
    folder = tmp_path_factory.mktemp("two")
    run(workshop, folder, *TWO)
    return folder


def test_two_processes_measure_what_one_does(workshop, of_two):
    """The same weights, the same validation metrics, to the last bit."""
    cfg = compose_config("train", workshop.overrides(*TWO))
    quiet_libraries()
    task = build_task(cfg, load_weights=False)
    task.load_state_dict(read_checkpoint(of_two / "last.ckpt")["state_dict"])
    trainer = lightning.Trainer(
        accelerator="cpu", logger=False, enable_progress_bar=False, enable_model_summary=False
    )
    (measured,) = trainer.validate(task, build_data(OmegaConf.to_object(cfg)), verbose=False)
    last = history(of_two)[-1]
    assert last["step"] == 12
    assert measured == {name: last[name] for name in measured}
    assert len(measured) > 10


@pytest.mark.parametrize("order", [(TWO, []), ([], TWO)])
def test_a_run_goes_on_with_another_number_of_processes(workshop, tmp_path, order):
    for steps, overrides in zip((6, 12), order, strict=True):
        run(workshop, tmp_path, f"steps={steps}", "scheduler.name=constant", "logger=none", *overrides)
    assert [entry["step"] for entry in history(tmp_path)] == [6, 12]
    assert read_checkpoint(tmp_path / "last.ckpt")["global_step"] == 12


def test_what_ends_a_process_ends_the_run(tmp_path):
    with pytest.raises(UserError, match=r"none.ckpt"):
        run_in_processes(2, read_checkpoint, tmp_path / "none.ckpt")
    with pytest.raises(SystemExit) as stop:
        run_in_processes(2, sys.exit, 143)
    assert stop.value.code == 143
