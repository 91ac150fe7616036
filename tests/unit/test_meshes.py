"""All meshes of a data set: none stops the others, and copies count once."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import box, put

from stereo_occ.data.meshes import inspect_files, without_copies
from stereo_occ.errors import UserError
from stereo_occ.shapes.layouts import list_folder
from stereo_occ.shapes.mesh_cache import MeshCache


class MoodyCache(MeshCache):
    """Where the name of a file says what befalls the process that inspects it."""

    def make(self, path: Path) -> Path:
        match path.stem:
            case "hang":
                time.sleep(300)
            case "crash":
                os.kill(os.getpid(), signal.SIGKILL)
            case "bug":
                raise IndexError("of several\nlines")
            case "full":
                raise UserError("the disk is full")
        return super().make(path)


def inspect(root, *names, time_limit=60.0, workers=2):
    for length, name in enumerate(names, start=2):
        put(box(1, 1, length), root, f"mug/{name}.stl")
    cache = MoodyCache(root / "cache", root, colors=True)
    files = list_folder(root).files
    return {
        record.file.object_id: record
        for record in inspect_files(files, cache, workers, time_limit, 4.0, progress=False)
    }


def test_a_hang_a_crash_and_a_bug_reject_their_file_alone(tmp_path):
    records = inspect(tmp_path, "good", "crash", "bug", "hang", "fine", time_limit=8.0)
    assert {name: record.outcome.status for name, record in records.items()} == {
        "good": "clean", "crash": "rejected", "bug": "rejected", "hang": "rejected", "fine": "clean"
    }  # fmt: skip
    assert records["hang"].outcome.reason == "took longer than data.time_limit=8 seconds"
    assert "ended with code -9, perhaps for want of memory" in records["crash"].outcome.reason
    assert records["bug"].outcome.reason == "failed: IndexError: of several lines"
    assert records["good"].shape().mesh.volume == pytest.approx(2 / 6**1.5, rel=1e-5)
    assert len(list((tmp_path / "cache").iterdir())) == 2, "failures are tried again"


def test_what_is_known_needs_no_process(tmp_path, monkeypatch):
    first = inspect(tmp_path, "a", "b", workers=1)
    monkeypatch.setattr(
        "stereo_occ.data.meshes.ProcessPool", lambda *_, **__: pytest.fail("started a process")
    )
    again = inspect(tmp_path, "a", "b")
    assert {name: record.entry for name, record in again.items()} == {
        name: record.entry for name, record in first.items()
    }


def test_a_cache_that_cannot_be_written_ends_the_reading(tmp_path):
    with pytest.raises(UserError, match="the disk is full"):
        inspect(tmp_path, "full", workers=1)


def test_of_copies_the_first_is_kept(tmp_path):
    put(box(1, 1, 2), tmp_path, "bowl/original.stl")
    put(box(1, 1, 2), tmp_path, "mug/copy.stl")
    put(box(1, 1, 3), tmp_path, "mug/other.stl")
    cache = MeshCache(tmp_path / "cache", tmp_path, colors=True)
    files = list_folder(tmp_path).files
    records = list(without_copies(inspect_files(files, cache, 1, 60, 4.0, progress=False)))
    assert {record.file.object_id: record.outcome.reason for record in records} == {
        "original": "", "copy": "is a copy of bowl/original", "other": ""
    }  # fmt: skip


def shell_of_a_bowl():
    """Of 2,500 corners, none of its moments like another."""
    profile = np.array([[0, 0], [0.3, 0.02], [0.5, 0.4], [0.46, 0.4], [0.28, 0.06], [0, 0.05]])
    mesh = trimesh.creation.revolve(profile, sections=64)
    mesh.merge_vertices()
    return mesh.apply_transform(np.diag([1.0, 1.1, 1.2, 1]))


def test_copies_are_copies_in_another_format_place_size_and_turn(tmp_path):
    mesh = shell_of_a_bowl()
    put(mesh, tmp_path, "bowl/a.stl")
    put(mesh, tmp_path, "bowl/b.obj")
    turn = trimesh.transformations.rotation_matrix(1.0, [1, 2, 3]) @ np.diag([30.0, 30, 30, 1])
    turn[:3, 3] = 5, 6, 7
    put(mesh.copy().apply_transform(turn), tmp_path, "bowl/c.glb")
    put(mesh.copy().apply_transform(np.diag([1.0, 1, 1.002, 1])), tmp_path, "bowl/d.ply")
    cache = MeshCache(tmp_path / "cache", tmp_path, colors=True)
    files = list_folder(tmp_path).files
    records = list(without_copies(inspect_files(files, cache, 1, 60, 4.0, progress=False)))
    assert {record.file.object_id: record.outcome.reason for record in records} == {
        "a": "", "b": "is a copy of bowl/a", "c": "is a copy of bowl/a", "d": ""
    }  # fmt: skip


def test_a_damaged_entry_is_one_line(tmp_path):
    record = inspect(tmp_path, "a", workers=1)["a"]
    record.entry.write_bytes(record.entry.read_bytes()[:-40])
    with pytest.raises(UserError, match=r"npz: cannot be read .*; delete it"):
        record.load()
