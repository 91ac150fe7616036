"""Checkpoints: plain data only, and whole or not there."""

import pickle
from pathlib import Path

import pytest
import torch
from samples import TINY, single_line

from stereo_occ import __version__
from stereo_occ.checkpoint import KEY, VERSION, build_task, plain, read_checkpoint
from stereo_occ.cli import compose_config
from stereo_occ.decision import Decision
from stereo_occ.errors import UserError
from stereo_occ.provenance import environment
from stereo_occ.resume import AtomicCheckpoints, step_to_resume
from stereo_occ.saved_config import training_config
from stereo_occ.trained import trained_model
from stereo_occ.writing import write_json


@pytest.fixture(scope="module")
def config():
    return plain(compose_config("train", TINY))


def save(path, config, **more):
    torch.save({KEY: {"version": VERSION, "config": config}, "global_step": 7, "state_dict": {}} | more, path)
    return path


class Payload:
    """Runs a command when it is unpickled."""

    def __init__(self, proof: Path) -> None:
        self.proof = proof

    def __reduce__(self):
        return (Path.touch, (self.proof,))


def test_a_pickled_payload_is_refused_and_does_not_run(tmp_path, config):
    proof = tmp_path / "it ran"
    path = save(tmp_path / "best.ckpt", config, extra=Payload(proof))
    with pytest.raises(UserError, match=r"best.ckpt: is damaged, or holds more than tensors") as refusal:
        read_checkpoint(path)
    assert single_line(str(refusal.value).replace(str(tmp_path), ""))
    assert not proof.exists()
    torch.load(path, weights_only=False)
    assert proof.exists()  # the payload works where it is let


@pytest.mark.parametrize("content", [b"", b"not a checkpoint", pickle.dumps({"a": 1})])
def test_a_damaged_or_foreign_file(tmp_path, content):
    path = tmp_path / "best.ckpt"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"checkpoint=.*best\.ckpt: ") as refusal:
        read_checkpoint(path)
    assert single_line(str(refusal.value).replace(str(tmp_path), ""))


def test_a_shortened_checkpoint(tmp_path, config):
    path = save(tmp_path / "best.ckpt", config)
    whole = path.read_bytes()
    for length in (10, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(UserError, match=r"best.ckpt: is damaged"):
            read_checkpoint(path)


@pytest.mark.parametrize("content", [torch.zeros(3), {"state_dict": {}}, [1, 2], {KEY: 3}])
def test_what_torch_saved_for_something_else(tmp_path, content):
    torch.save(content, tmp_path / "resnet.pt")
    with pytest.raises(UserError, match="is no checkpoint of a training run"):
        read_checkpoint(tmp_path / "resnet.pt")


def test_another_version(tmp_path, config):
    path = save(tmp_path / "best.ckpt", config, **{KEY: {"version": VERSION + 1, "config": config}})
    with pytest.raises(UserError, match=rf"has format version {VERSION + 1}, expected {VERSION}"):
        read_checkpoint(path)


@pytest.mark.parametrize("change", ["missing", "added", "another's", "not a number"])
def test_weights_that_do_not_fit(config, change):
    task = build_task(training_config(config))
    state = dict(task.state_dict())
    checkpoint = {KEY: {"version": VERSION, "config": config}, "global_step": 7, "state_dict": state}
    trained = trained_model(checkpoint, "x.ckpt")
    assert (trained.step, trained.decision) == (7, Decision(0.5))
    for name, value in trained.model.state_dict().items():
        assert torch.equal(value, task.model.state_dict()[name])
    trained_model(checkpoint | {"state_dict": state | {"auxiliary.head.bias": torch.zeros(1)}}, "x.ckpt")
    first = next(name for name in state if name.startswith("model."))
    match change:
        case "missing":
            del state[first]
        case "added":
            state["model.more"] = torch.zeros(1)
        case "another's":
            state[first] = torch.zeros(1)
        case "not a number":
            state[first] = torch.full_like(state[first], torch.nan)
    complaint = "holds NaN" if change == "not a number" else "its weights do not fit"
    with pytest.raises(UserError, match=f"checkpoint=x.ckpt: {complaint}"):
        trained_model(checkpoint, "x.ckpt")


def test_saving_replaces_the_old_checkpoint_or_leaves_it(tmp_path, config, monkeypatch):
    path = save(tmp_path / "last.ckpt", config)
    before = path.read_bytes()

    def fails(checkpoint, file):
        file.write(b"half of it")
        raise RuntimeError("PytorchStreamWriter failed writing file")

    with monkeypatch.context() as patch:
        patch.setattr(torch, "save", fails)
        with pytest.raises(UserError, match=r"last.ckpt: cannot write the checkpoint \(Pytorch"):
            AtomicCheckpoints().save_checkpoint({"a": 1}, path)
    assert path.read_bytes() == before
    AtomicCheckpoints().save_checkpoint({"a": 1}, path)
    assert torch.load(path, weights_only=True) == {"a": 1}
    assert [file.name for file in tmp_path.iterdir()] == ["last.ckpt"]


def test_a_run_goes_on_only_as_itself(tmp_path, config):
    objects = {"train": ["0/mug/a"], "val": []}
    path = save(tmp_path / "last.ckpt", config, optimizer_states=[])
    assert step_to_resume(path, config, objects) == 7
    longer = config | {"steps": 1000, "progress": True, "workers": 7}
    assert step_to_resume(path, longer, objects) == 7
    with pytest.raises(
        UserError, match=r"holds a run with another model, seed; choose another hydra.run.dir"
    ):
        step_to_resume(path, config | {"seed": 1, "model": config["model"] | {"width": 9}}, objects)


def test_a_run_does_not_go_on_from_weights_alone(tmp_path, config):
    path = save(tmp_path / "last.ckpt", config)
    with pytest.raises(UserError, match=r"last.ckpt: holds weights alone.*say resume=never init=FILE"):
        step_to_resume(path, config, {})


def test_json_is_written_whole(tmp_path):
    write_json(tmp_path / "metrics.json", {"iou": 0.5})
    with pytest.raises(TypeError):
        write_json(tmp_path / "metrics.json", {"iou": object()})
    assert (tmp_path / "metrics.json").read_text() == '{\n  "iou": 0.5\n}\n'


def test_the_environment_names_versions():
    facts = environment()
    assert facts["schema"] == 2
    assert (facts["stereo_occ"], facts["torch"]) == (__version__, torch.__version__)
    assert facts["cpu"]
    assert facts["threads"] >= 1
