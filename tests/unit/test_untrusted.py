"""Files from elsewhere that would run code: each payload works where it is let, is refused here, and does not run."""

import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from checkpoints import checkpoint_of
from entry_points import EntryPoints
from hydra.utils import instantiate
from mesh_files import box, put

from stereo_occ.shapes.mesh_cache import MeshCache

PAYLOAD = {"_target_": "os.mkdir", "path": "it_ran"}


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    return EntryPoints(tmp_path, monkeypatch, capsys)


@pytest.fixture
def proof(tmp_path):
    """Appears when a payload runs in the folder of the command."""
    return tmp_path / "it_ran"


def experiment(folder, text):
    path = folder / "from_elsewhere" / "experiment" / "theirs.yaml"
    path.parent.mkdir(parents=True)
    path.write_text(f"# @package _global_\n{text}")


def test_the_payload_works_where_it_is_let(command, proof, monkeypatch):
    monkeypatch.chdir(command.folder)
    instantiate(PAYLOAD)
    assert proof.is_dir()


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"hydra": {"callbacks": {"x": PAYLOAD}}}, "hydra.callbacks.x._target_=os.mkdir: would run code"),
        (
            {"hydra": {"job_logging": {"handlers": {"x": {"()": "os.mkdir", "path": "it_ran"}}}}},
            "hydra.job_logging.handlers.x.()=os.mkdir: would run code",
        ),
        (
            {"hydra": {"hydra_logging": {"formatters": {"x": {"class": "os.mkdir"}}}}},
            "hydra.hydra_logging.formatters.x.class=os.mkdir: would run code",
        ),
        ({"hydra": {"launcher": PAYLOAD}}, "hydra.launcher."),
        (
            {"hydra": {"job": {"env_set": {"LD_PRELOAD": "x.so"}}}},
            "hydra.job.env_set=LD_PRELOAD: variables of",
        ),
        (PAYLOAD, "experiment=theirs: In 'experiment/theirs': ConfigKeyError"),
        ({"model": PAYLOAD}, "model"),
        ({"optimizer": PAYLOAD}, "optimizer"),
    ],
)
def test_a_configuration_from_elsewhere_cannot_name_code(command, proof, settings, line):
    experiment(command.folder, yaml.safe_dump(settings))
    outcome = command("train", ["--config-dir", "from_elsewhere", "experiment=theirs", "--multirun"])
    assert outcome.code == 2, outcome
    assert any(line in said for said in outcome.lines), outcome.lines
    assert "Traceback" not in outcome.err
    assert not proof.exists()
    assert outcome.touched == []


def test_a_yaml_tag_names_no_code(command, proof):
    experiment(command.folder, "steps: !!python/object/apply:os.mkdir [it_ran]\n")
    outcome = command("train", ["--config-dir", "from_elsewhere", "experiment=theirs"])
    assert (outcome.code, len(outcome.lines)) == (2, 1), outcome
    assert "Traceback" not in outcome.err
    assert not proof.exists()


def test_what_is_harmless_passes_that_check(command):
    experiment(command.folder, "steps: many\nhydra:\n  job_logging:\n    root: {level: WARNING}\n")
    outcome = command("train", ["--config-dir", "from_elsewhere", "experiment=theirs"])
    assert "would run" not in outcome.err
    assert outcome.code == 2


class Payload:
    """Makes the proof when it is unpickled."""

    def __reduce__(self):
        return (Path.mkdir, (Path("it_ran"),))


@pytest.mark.parametrize(
    ("flags", "line"),
    [
        (
            ["--experimental-rerun", "job.pickle"],
            "--experimental-rerun job.pickle: a pickled job can run any code",
        ),
        (
            ["--config-path", "from_elsewhere"],
            "--config-path from_elsewhere: the settings are this package's own",
        ),
    ],
)
def test_flags_that_leave_out_the_checks(command, proof, flags, line):
    (command.folder / "job.pickle").write_bytes(pickle.dumps(Payload()))
    outcome = command("train", flags)
    assert (outcome.code, len(outcome.lines)) == (2, 1), outcome
    assert line in outcome.err
    assert not proof.exists()


def test_an_archive_writes_nothing(command, proof):
    """A checkpoint is a zip file; a record of it that leads out of its folder is read by nobody."""
    path = checkpoint_of(command.folder)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("../it_ran", "x")
        archive.writestr("best/../../it_ran", "x")
    outcome = command("export", ["checkpoint=best.ckpt", "output=w"])
    assert "Traceback" not in outcome.err
    assert not proof.exists()
    assert not (command.folder.parent / "it_ran").exists()


def test_a_small_file_that_stands_for_a_huge_one(command):
    """torch compresses nothing; a record of zeros could be a thousand times its size."""
    path = checkpoint_of(command.folder)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("best/data/0000", bytes(10_000_000))
    outcome = command("export", ["checkpoint=best.ckpt", "output=w"])
    assert (outcome.code, len(outcome.lines)) == (2, 1), outcome
    assert "best.ckpt: is damaged, or holds more than tensors and plain values" in outcome.err


def test_an_entry_of_the_mesh_cache_is_not_unpickled(tmp_path, proof, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = put(box(1, 1, 2), tmp_path, "mug/a.stl")
    cache = MeshCache(tmp_path / "cache", tmp_path, colors=False)
    entry = cache.make(path)
    np.savez(entry, header=np.array([Payload()], dtype=object), allow_pickle=True)
    assert cache.find(path) is None
    assert not proof.exists()
    with np.load(entry, allow_pickle=True) as arrays:  # where it is let
        arrays["header"]
    assert proof.is_dir()
