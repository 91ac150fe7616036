"""Absurd and hostile mesh files: each is left out with a reason of one line, in bounded time and memory."""

import json
import os
import re
import struct
from pathlib import Path

import numpy as np
import pytest
from mesh_files import box, put
from samples import single_line

from stereo_occ.data.meshes import MeshRecord, inspect_files
from stereo_occ.quality_report import write_quality_report
from stereo_occ.shapes import reading
from stereo_occ.shapes.inspection import inspect_mesh
from stereo_occ.shapes.layouts import MeshFile, list_folder
from stereo_occ.shapes.mesh_cache import MeshCache


def obj(vertices, faces="f 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n"):
    return "".join(f"v {x} {y} {z}\n" for x, y, z in vertices) + faces


def corners(scale):
    return np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * scale


PLY = "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n"
GLTF = {
    "asset": {"version": "2.0"},
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "../../secret.bin"}],
}

FILES = {
    "an empty file": ("a.obj", "", "holds no triangles|cannot be read"),
    "text": ("a.stl", "not a mesh at all", "cannot be read|holds no triangles"),
    "points without triangles": ("a.obj", obj(corners(1), ""), "holds no triangles|cannot be read"),
    "all corners in one place": ("a.obj", obj(corners(0)), "is 0 units large, expected 0.0001 to 1e\\+07; scale it"),
    "too small": ("a.obj", obj(corners(1e-6)), "is 1e-06 units large"),
    "too large": ("a.obj", obj(corners(1e12)), "is 1e\\+12 units large"),
    "beyond single precision": ("a.obj", obj(corners(1e300)), "is 1e\\+300 units large|not finite"),
    "NaN": ("a.obj", obj([["nan", 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), "vertices that are not finite"),
    "infinity": ("a.obj", obj([["inf", 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), "vertices that are not finite"),
    "faces of vertices that are not there": ("a.obj", obj(corners(1), "f 1 2 99\n"), "cannot be read|holds no"),
    "a flat sheet": ("a.obj", obj([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f 1 2 3\nf 1 3 4\n"), "."),
    "a PLY of a trillion vertices": ("a.ply", PLY.format(n=10**12) + "end_header\n", "cannot be read"),
    "a PLY of minus one vertex": ("a.ply", PLY.format(n=-1) + "end_header\n", "cannot be read|holds no triangles"),
    "an STL of four billion triangles": (
        "a.stl", b"\0" * 80 + struct.pack("<I", 2**32 - 1) + b"\0" * 50, "cannot be read",
    ),
    "an OFF of a billion faces": ("a.off", "OFF\n3 1000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "."),
    "a GLB with a header alone": ("a.glb", b"glTF" + struct.pack("<II", 2, 2**31), "cannot be read"),
    "a glTF that reads elsewhere": ("a.gltf", json.dumps(GLTF), "cannot be read: FileNotFoundError"),
    "a glTF that reads an absolute path": (
        "a.gltf", json.dumps(GLTF).replace("../../secret.bin", "/etc/hostname"), "cannot be read: FileNotFoundError",
    ),
}  # fmt: skip


#: Its one face has no extent; the vertices that no face uses have.
DEGENERATE = (
    "a.ply",
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 0 0\n",
    "",
)


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_left_out_with_a_reason(tmp_path, name):
    file, content, reason = FILES[name]
    root = tmp_path / "a" / "root"
    root.mkdir(parents=True)
    (tmp_path / "secret.bin").write_bytes(np.zeros((3, 3), np.float32).tobytes())
    path = root / file
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    outcome = inspect_mesh(path, root, colors=True)
    assert outcome.status == "rejected"
    assert single_line(outcome.reason)
    assert re.search(reason, outcome.reason), outcome.reason


def test_each_of_them_has_its_row_and_its_place_in_the_report(tmp_path):
    root = tmp_path / "root"
    (root / "mug").mkdir(parents=True)
    records = []
    for number, (file, content, _) in enumerate([*FILES.values(), DEGENERATE]):
        path = root / "mug" / f"{number}{Path(file).suffix}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        records.append(
            MeshRecord(MeshFile(path, "mug", str(number)), inspect_mesh(path, root, colors=True), None)
        )
    write_quality_report(tmp_path, records, root, progress=False)
    rows = (tmp_path / "quality.csv").read_text().splitlines()
    assert len(rows) == 1 + len(records)
    assert (tmp_path / "quality.png").stat().st_size > 1000


def test_stated_limits(tmp_path, monkeypatch):
    path = put(box(1, 1, 2), tmp_path, "a.stl")
    monkeypatch.setattr(reading, "MOST_TRIANGLES", 11)
    assert inspect_mesh(path, tmp_path, colors=False).reason.endswith(
        "triangles, at most 1.1e-05 are read; simplify it"
    )
    with path.open("r+b") as file:
        file.truncate(2_000_000_000)  # sparse
    assert inspect_mesh(path, tmp_path, colors=False).reason == "has 2.0 GB, at most 1 are read; simplify it"


class Greedy(MeshCache):
    """Where one file needs five gigabytes."""

    def make(self, path: Path) -> Path:
        if path.stem == "greedy":
            np.ones(5_000_000_000, np.uint8).sum()
        return super().make(path)


def test_none_of_them_stops_a_data_set(tmp_path):
    """A pipe nobody writes to, a device without an end, a vast file, one that eats memory, and two good ones."""
    put(box(1, 1, 2), tmp_path, "mug/good.stl")
    put(box(1, 1, 3), tmp_path, "mug/greedy.stl")
    put(box(1, 1, 4), tmp_path, "mug/fine.stl")
    os.mkfifo(tmp_path / "mug" / "pipe.obj")
    (tmp_path / "mug" / "endless.obj").symlink_to("/dev/zero")
    with (tmp_path / "mug" / "vast.obj").open("wb") as file:
        file.truncate(10**12)
    cache = Greedy(tmp_path / "cache", tmp_path, colors=True)
    records = inspect_files(list_folder(tmp_path).files, cache, 1, 60.0, 2.0, progress=False)
    assert {record.file.object_id: record.outcome.reason for record in records} == {
        "good": "",
        "fine": "",
        "greedy": "needs more memory than data.memory_limit=2 GB",
        "pipe": "is no regular file",
        "endless": "is no regular file",
        "vast": "has 1000.0 GB, at most 1 are read; simplify it",
    }
