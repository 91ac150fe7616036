"""Every mistake in the tables of ``bad_pairs`` and ``bad_files``: one line, exit code 2, nothing written.

The commands run in this process; ``test_reconstruct``, ``test_cli`` and others start a few as programs.
"""

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import bad_files
import bad_pairs
import numpy as np
import pytest
from bad_pairs import Case
from checkpoints import checkpoint_of
from entry_points import EntryPoints, Outcome
from omegaconf import OmegaConf
from permissions import modes_obeyed
from samples import TINY, pools_of, solid, views_of
from trimesh.creation import box

import stereo_occ
from stereo_occ import reconstructor
from stereo_occ.cli import compose_config
from stereo_occ.data.prepare import locate
from stereo_occ.data.shard_writing import write_shard
from stereo_occ.trained import load_trained

EXAMPLES = Path(stereo_occ.__file__).parents[1] / "examples"

RECTIFIED = ["rig=rectified", "placement=free"]

SMALL = ["scale.counts={mug:1,bowl:1,bottle:1}", "data.views=1", "workers=1", "progress=false"]


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    """Of a model for rectified pairs."""
    return checkpoint_of(tmp_path_factory.mktemp("run"), name="tiny.ckpt")


@pytest.fixture(scope="module")
def trained(checkpoint):
    """Its model."""
    return load_trained(str(checkpoint))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A checkpoint for the paper's pairs, and beside it the shards of its data set, of noise."""
    folder = tmp_path_factory.mktemp("run")
    checkpoint_of(folder, "rig=paper", "placement=paper", name="tiny.ckpt")
    pairs = OmegaConf.to_object(compose_config("train", [*TINY, f"paths.data='{folder / 'data'}'"]))
    located = locate(pairs, progress=False)
    for source, path in zip(located.sources, located.paths, strict=True):
        shape = solid(*source.key)
        write_shard(path, shape, views_of(2, side=32), pools_of(shape, points=50))
    return folder


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    return EntryPoints(tmp_path, monkeypatch, capsys)


def replaced(arguments: Sequence[str], others: Sequence[str]) -> list[str]:
    """Arguments with those of the same key replaced."""
    by_key = {argument.partition("=")[0]: argument for argument in (*arguments, *others)}
    return list(by_key.values())


def refused(case: Case, outcome: Outcome) -> None:
    """One line that names the thing and says what to do, exit code 2, no file or folder written."""
    assert outcome.code == 2, outcome
    assert len(outcome.lines) == 1, outcome.lines
    assert re.search(case.message, outcome.err), outcome.err
    assert outcome.err.startswith("stereo_occ: ")
    assert len(outcome.err) < 450
    assert "Traceback" not in outcome.out + outcome.err
    assert outcome.touched == []
    assert not list(Path.cwd().rglob("it_ran"))


def name_of(case: Case) -> str:
    return case.name


def put_pair(folder: Path, checkpoint: Path) -> None:
    for source, name in (("left.png",) * 2, ("right.png",) * 2, ("calibration.yaml", "rig.yaml")):
        shutil.copy(EXAMPLES / source, folder / name)
    shutil.copy(checkpoint, folder / "tiny.ckpt")


PAIR = [
    "left=left.png", "right=right.png", "rig=rig.yaml", "checkpoint=tiny.ckpt", "output=mug.ply",
    "resolution=8", "threshold=0.5", "preview=false",
]  # fmt: skip


@pytest.mark.parametrize(
    "case", [*bad_pairs.IMAGES, *bad_pairs.CALIBRATIONS, *bad_pairs.SETTINGS], ids=name_of
)
def test_reconstruct(case, command, checkpoint, trained, monkeypatch):
    monkeypatch.setattr(reconstructor, "load_trained", lambda _: trained)  # as good as new, and half the time
    put_pair(command.folder, checkpoint)
    case.prepare(command.folder)
    refused(case, command("reconstruct", replaced(PAIR, case.arguments)))


@pytest.mark.parametrize("case", bad_files.CHECKPOINTS, ids=name_of)
def test_export(case, command, checkpoint):
    shutil.copy(checkpoint, command.folder / "tiny.ckpt")
    case.prepare(command.folder)
    refused(case, command("export", replaced(["checkpoint=tiny.ckpt", "output=out"], case.arguments)))


@pytest.mark.parametrize("case", bad_files.REPORTS, ids=name_of)
def test_report(case, command):
    case.prepare(command.folder)
    refused(case, command("report", replaced(["runs=[evaluation]"], case.arguments)))


def test_evaluation_into_the_folder_of_a_training(command, checkpoint):
    (command.folder / "run").mkdir()
    shutil.copy(checkpoint, command.folder / "run" / "best.ckpt")
    outcome = command("evaluate", ["checkpoint=run/best.ckpt", "hydra.run.dir=run"])
    refused(Case("", r"hydra\.run\.dir=.*run: holds a training"), outcome)


@pytest.mark.parametrize("case", bad_files.SHARDS, ids=name_of)
def test_evaluate(case, command, run):
    shutil.copytree(run, command.folder, dirs_exist_ok=True)
    case.prepare(command.folder)
    outcome = command(
        "evaluate",
        ["checkpoint=tiny.ckpt", "paths.data=data", "subset=all", "views=1", "points=10", "meshes=0", "examples=0",
         "progress=false", "categories=mug"],
    )  # fmt: skip
    refused(case, outcome)


@pytest.mark.parametrize("case", [*bad_files.FOLDERS, *bad_files.SETTINGS], ids=name_of)
def test_render(case, command):
    case.prepare(command.folder)
    given = ["progress=false", "workers=1"]
    if case in bad_files.FOLDERS:
        given += ["data=meshes", "data.root=meshes"]
    arguments = replaced(given, case.arguments)
    if not any(argument in ("data=meshes", "data=shapenet") for argument in arguments):
        arguments = [argument for argument in arguments if not argument.startswith("data.root=")]
    refused(case, command("render", arguments))


@pytest.mark.parametrize("case", bad_files.INSPECTIONS, ids=name_of)
def test_inspect(case, command):
    case.prepare(command.folder)
    refused(case, command("inspect", ["data.root=meshes", "progress=false", "workers=1", *case.arguments]))


@pytest.mark.parametrize("case", bad_files.TRAININGS, ids=name_of)
def test_train(case, command, checkpoint):
    shutil.copy(checkpoint, command.folder / "tiny.ckpt")
    case.prepare(command.folder)
    refused(case, command("train", replaced([*TINY, *RECTIFIED], case.arguments)))


def test_meshes_for_training_alone_leave_no_run_folder(command):
    """What is read of the meshes is kept: another table of them goes on from there."""
    bad_files.mesh_folder(("t.csv", "file,category,subset\nmug.off,mug,train\n"))(command.folder)
    box(extents=(0.1, 0.1, 0.1)).export(command.folder / "meshes" / "mug.off")
    given = [
        "data=meshes",
        "data.root=meshes",
        "data.table=meshes/t.csv",
        "categories=mug",
        "paths.data=cache",
    ]
    tiny = [override for override in TINY if not override.startswith("scale.counts")]
    outcome = command("train", [*tiny, *RECTIFIED, *given, "hydra.run.dir=run"])
    assert outcome.code == 2
    (line,) = outcome.lines
    assert line.startswith("stereo_occ: data.name=meshes: no object is in val, by data.fractions=[")
    assert [name for name in outcome.touched if not name.startswith("cache")] == []


@pytest.mark.parametrize("case", bad_files.COMPARISONS, ids=name_of)
def test_compare(case, command):
    case.prepare(command.folder)
    refused(case, command("compare", case.arguments))


@pytest.mark.parametrize(
    ("program", "arguments", "closed", "message"),
    [
        ("reconstruct", PAIR, "left.png", r"left=left\.png: cannot be read \(.*Permission denied"),
        ("reconstruct", PAIR, "rig.yaml", r"rig=rig\.yaml: cannot be read \(Permission denied\)"),
        ("reconstruct", PAIR, "tiny.ckpt", r"checkpoint=tiny\.ckpt: cannot be read \(Permission denied\)"),
        ("reconstruct", [*PAIR, "output=closed/mug.ply"], "closed",
         r"output=closed/mug\.json: cannot be written \(Permission denied\)"),
        ("reconstruct", [*PAIR, "left=closed/left.png"], "closed", r"Permission denied; choose another folder"),
        ("export", ["checkpoint=tiny.ckpt", "output=closed/w"], "closed", r"output=closed/w\..*cannot be written"),
        ("render", ["paths.outputs=closed/outputs"], "closed", r"Permission denied; choose another folder"),
        ("render", ["data=meshes", "data.root=closed"], "closed", r"Permission denied"),
        ("render", [*SMALL, "paths.data=closed/data"], "closed",
         r"mug_0000\.h5: Permission denied; choose another folder"),
        ("train", [*TINY, "hydra.run.dir=closed/run"], "closed", r"closed/run: Permission denied; choose another"),
    ],
)  # fmt: skip
def test_without_permission(command, checkpoint, program, arguments, closed, message):
    folder = command.folder
    put_pair(folder, checkpoint)
    if closed == "closed":
        (folder / closed).mkdir()
    (folder / closed).chmod(0)
    try:
        with modes_obeyed():
            outcome = command(program, replaced([], arguments))
    finally:
        (folder / closed).chmod(0o700)
    refused(Case("", message), outcome)


def test_the_tables_are_long_enough_and_say_each_thing_once():
    tables = [*vars(bad_pairs).values(), *vars(bad_files).values()]
    names = [
        case.name for table in tables if isinstance(table, list) for case in table if isinstance(case, Case)
    ]
    assert len(names) >= 150
    assert all(
        case.message
        for table in tables
        if isinstance(table, list)
        for case in table
        if isinstance(case, Case)
    )
    assert np.unique(names).size >= len(names) - 8  # settings that two programs share
