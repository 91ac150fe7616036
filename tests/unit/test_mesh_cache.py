"""Repaired once: what the cache keeps, and what it must not take for the same."""

import os
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from mesh_files import box, put

from stereo_occ.errors import UserError
from stereo_occ.shapes import mesh_cache
from stereo_occ.shapes.inspection import Inspection, inspect_mesh
from stereo_occ.shapes.mesh_cache import MeshCache, load


@pytest.fixture
def cache(tmp_path):
    return MeshCache(tmp_path / "cache", tmp_path, colors=True)


def test_an_entry_says_what_inspecting_said(tmp_path, cache):
    mesh = box(1, 2, 3)
    mesh.visual.vertex_colors = np.random.default_rng(0).integers(256, size=(8, 4), dtype=np.uint8)
    path = put(mesh, tmp_path, "mug/a/model.ply")
    assert cache.find(path) is None
    entry = cache.make(path)
    assert cache.find(path) == entry
    found, made = load(entry), inspect_mesh(path, tmp_path, colors=True)
    np.testing.assert_array_equal(found.mesh.vertices, made.mesh.vertices)
    np.testing.assert_array_equal(found.mesh.faces, made.mesh.faces)
    np.testing.assert_array_equal(found.colors, made.colors)
    for name in ("steps", "measures", "reason", "checksum", "solid", "side_files", "status"):
        assert getattr(found, name) == getattr(made, name)
    assert load(entry, header_only=True).mesh is None


def test_rejected_meshes_are_kept_too_but_not_files_that_cannot_be_read(tmp_path, cache):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    flat, noise = put(sheet, tmp_path, "mug/flat.ply"), tmp_path / "mug" / "noise.ply"
    noise.write_bytes(b"ply\nnonsense")
    assert load(cache.make(flat)).reason
    assert cache.find(flat) is not None
    assert load(cache.make(noise)).reason.startswith("cannot be read")
    assert cache.find(noise) is None


def test_the_same_file_elsewhere_is_known_and_a_changed_one_is_not(tmp_path, cache):
    path = put(box(1, 2, 3), tmp_path, "mug/a/model.stl")
    entry = cache.make(path)
    assert cache.find(put(box(1, 2, 3), tmp_path, "bowl/other.stl")) == entry
    put(box(1, 2, 4), tmp_path, "mug/a/model.stl")
    assert cache.find(path) is None
    assert cache.find(tmp_path / "mug" / "a" / "absent.stl") is None


def test_the_same_file_beside_other_materials_is_another(tmp_path, cache):
    for color, values in (("red", "1 0 0"), ("blue", "0 0 1")):
        folder = tmp_path / "mug" / color
        folder.mkdir(parents=True)
        (folder / "model.obj").write_text("mtllib m.mtl\nusemtl m\n" + box(1, 1, 1).export(file_type="obj"))
        (folder / "m.mtl").write_text(f"newmtl m\nKd {values}\n")
        cache.make(folder / "model.obj")
    colors = [load(cache.find(tmp_path / "mug" / color / "model.obj")).colors[0] for color in ("red", "blue")]
    np.testing.assert_array_equal(colors, [[255, 0, 0], [0, 0, 255]])


def test_changed_materials_are_noticed(tmp_path, cache):
    path = tmp_path / "model.obj"
    path.write_text("mtllib red.mtl\nusemtl red\n" + box(1, 1, 1).export(file_type="obj"))
    entries = []
    for color in (None, "1 0 0", "0 0 1"):
        if color:
            (tmp_path / "red.mtl").write_text(f"newmtl red\nKd {color}\n")
        assert cache.find(path) is None
        cache.make(path)
        entries.append(load(cache.find(path)))
    assert entries[0].colors is None
    np.testing.assert_array_equal(entries[1].colors[0], [255, 0, 0])
    np.testing.assert_array_equal(entries[2].colors[0], [0, 0, 255])
    assert len({entry.checksum for entry in entries}) == 3


def test_other_code_and_the_wish_for_colours_have_entries_of_their_own(tmp_path, cache, monkeypatch):
    path = put(box(1, 2, 3), tmp_path, "a.stl")
    cache.make(path)
    assert MeshCache(cache.folder, tmp_path, colors=False).find(path) is None
    monkeypatch.setattr(mesh_cache, "_code", lambda: "another version")
    assert cache.find(path) is None


def test_a_damaged_entry_is_made_again_and_none_is_half_written(tmp_path, cache, monkeypatch):
    path = put(box(1, 2, 3), tmp_path, "a.stl")
    entry = cache.make(path)
    entry.write_bytes(entry.read_bytes()[:-40])
    assert cache.find(path) is None

    def killed(*_):
        raise KeyboardInterrupt

    entry.unlink()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", killed)
        with pytest.raises(KeyboardInterrupt):
            cache.make(path)
    assert list(cache.folder.iterdir()) == []


def test_a_cache_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("where the folder should be")
    cache = MeshCache(tmp_path / "file", tmp_path, colors=True)
    with pytest.raises(UserError, match=r"file: cannot be written .*set paths.data"):
        cache.make(put(box(1, 1, 1), tmp_path, "a.stl"))


def test_the_checksum_tells_colours_apart(tmp_path):
    mesh = box(1, 1, 1)
    plain = inspect_mesh(put(mesh, tmp_path, "a.ply"), tmp_path, colors=True)
    mesh.visual.vertex_colors = [1, 2, 3, 255]
    colored = inspect_mesh(put(mesh, tmp_path, "a.ply"), tmp_path, colors=True)
    assert plain.checksum != colored.checksum
    assert plain.checksum == inspect_mesh(tmp_path / "a.ply", tmp_path, colors=False).checksum
    assert plain.solid == colored.solid == plain.checksum


def test_status():
    solid = Inspection(box(1, 1, 1))
    assert [solid.status, replace(solid, steps=("x",)).status, replace(solid, reason="y").status] == [
        "clean", "repaired", "rejected"
    ]  # fmt: skip
