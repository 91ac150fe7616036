"""Disks that are full from the start or become so: one line, and no file is half there."""

import ctypes
import os
import shutil
from pathlib import Path

import pytest
from checkpoints import checkpoint_of
from entry_points import EntryPoints, files
from omegaconf import OmegaConf
from samples import TINY, pools_of, solid, views_of

import stereo_occ
from stereo_occ.cli import compose_config
from stereo_occ.data.prepare import locate
from stereo_occ.data.shard_writing import write_shard

EXAMPLES = Path(stereo_occ.__file__).parents[1] / "examples"

SIZE = 8_000_000  # bytes of the disk


@pytest.fixture
def disk(tmp_path):
    """A small file system of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mount(b"none", str(folder).encode(), b"tmpfs", 0, f"size={SIZE}".encode()):
        pytest.skip(f"cannot mount a file system: {os.strerror(ctypes.get_errno())}")
    yield folder
    libc.umount2(str(folder).encode(), 2)  # detached, whoever still has a file open


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    return EntryPoints(tmp_path, monkeypatch, capsys)


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A checkpoint for rectified pairs, one for the paper's, the shards of its data, the example pair."""
    folder = tmp_path_factory.mktemp("work")
    checkpoint_of(folder, name="rectified.ckpt")
    checkpoint_of(folder, "rig=paper", "placement=paper", name="paper.ckpt")
    pairs = OmegaConf.to_object(compose_config("train", [*TINY, f"paths.data='{folder / 'data'}'"]))
    located = locate(pairs, progress=False)
    for source, path in zip(located.sources, located.paths, strict=True):
        shape = solid(*source.key)
        write_shard(path, shape, views_of(2, side=32), pools_of(shape, points=2000))
    for name in ("left.png", "right.png", "calibration.yaml"):
        shutil.copy(EXAMPLES / name, folder / name)
    return folder


def fill(disk, free):
    """Leave ``free`` bytes."""
    with (disk / "filler").open("wb") as file:
        file.write(bytes(SIZE - free))


def test_the_disk_is_a_disk(disk):
    fill(disk, 8192)
    with pytest.raises(OSError, match="No space left"):
        (disk / "more").write_bytes(bytes(20_000))


PAIR = ["left=left.png", "right=right.png", "rig=calibration.yaml", "checkpoint=rectified.ckpt", "threshold=0.5",
        "resolution=32"]  # fmt: skip
EVALUATION = ["checkpoint=paper.ckpt", "paths.data=data", "subset=test", "views=1", "points=100", "meshes=0",
              "examples=1", "mesh_resolution=16", "progress=false"]  # fmt: skip


@pytest.mark.parametrize(
    ("program", "arguments", "free"),
    [
        ("reconstruct", [*PAIR, "output=disk/mug.glb"], 0),
        ("reconstruct", [*PAIR, "output=disk/mug.glb", "preview=false"], 8192),
        ("export", ["checkpoint=paper.ckpt", "output=disk/w"], 0),
        ("export", ["checkpoint=paper.ckpt", "output=disk/w"], 100_000),
        ("evaluate", [*EVALUATION, "hydra.run.dir=disk/run"], 0),
        ("evaluate", [*EVALUATION, "hydra.run.dir=disk/run"], 16_384),
        ("evaluate", [*EVALUATION, "hydra.run.dir=disk/run"], 65_536),
        ("train", [*TINY, "paths.data=data", "hydra.run.dir=disk/run"], 0),
        ("train", [*TINY, "paths.data=data", "hydra.run.dir=disk/run"], 16_384),
        ("train", [*TINY, "paths.data=data", "hydra.run.dir=disk/run"], 1_000_000),
        ("train", [*TINY, "paths.data=data", "hydra.run.dir=disk/run", "logger=none"], 6_000_000),
        ("render", ["data.image_side=32", "data.views=1", "categories=mug", "scale.counts.mug=1", "workers=1",
                    "data.pool_size=2000", "progress=false", "paths.data=disk/data"], 12_288),
    ],
    ids=lambda value: str(value) if isinstance(value, str | int) else "",
)  # fmt: skip
def test_a_full_disk_is_one_line_and_leaves_no_half_file(
    command, work, disk, program, arguments, free, request
):
    if program == "render":
        request.getfixturevalue("egl")
    for path in work.iterdir():
        (command.folder / path.name).symlink_to(path)
    fill(disk, free)
    outcome = command(program, arguments)
    assert outcome.code == 2, outcome
    assert len(outcome.lines) == 1, outcome.err
    assert "No space left on device" in outcome.err, outcome.err
    assert "Traceback" not in outcome.out + outcome.err
    assert not list(disk.rglob("*.part"))
    for name, (_, size) in files(disk).items():
        path = disk / name
        if path.is_file() and "tensorboard" not in name and name != "filler":
            assert size, f"{name} is empty"
            assert path.suffix in (".yaml", ".csv", ".json", ".ckpt", ".glb", ".png", ".log"), name
