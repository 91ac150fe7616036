"""From a folder of meshes to shards, subsets and the report on what became of each file."""

import csv

import numpy as np
import pytest
import trimesh
from mesh_files import box, put
from omegaconf import OmegaConf
from PIL import Image
from runs import program

from stereo_occ.cli import compose_config
from stereo_occ.data import meshes as meshes_module
from stereo_occ.data import prepare as prepare_module
from stereo_occ.data.datamodule import PairsDataModule
from stereo_occ.data.objects import list_objects
from stereo_occ.data.prepare import prepare
from stereo_occ.data.shard import Shard
from stereo_occ.errors import UserError

SMALL = ["data.image_side=32", "data.views=2", "data.pool_size=200", "workers=1"]


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Six mugs of different length, one of them far from the origin and large, and a table that divides five."""
    root = tmp_path_factory.mktemp("root")
    lines = ["file,category,subset"]
    for length, subset in zip(range(2, 8), ("train", "train", "val", "test", "test", ""), strict=True):
        mesh = box(1, 1, length)
        if length == 5:
            mesh.apply_transform(trimesh.transformations.scale_and_translate(300, [1000, 0, -7]))
        put(mesh, root, f"mug/m{length}.stl")
        lines.append(f"mug/m{length}.stl,mug,{subset}")
    (root / "table.csv").write_text("\n".join(lines) + "\n")
    return root


@pytest.fixture(scope="module")
def data_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("data")


def pairs(root, data_folder, *overrides):
    words = [*SMALL, "data=meshes", f"data.root={root}", f"paths.data={data_folder}", *overrides]
    return OmegaConf.to_object(compose_config("render", words))


def ids(shards):
    found = []
    for shard in shards:
        with shard:
            found.append(shard.object_id)
    return found


@pytest.fixture(scope="module")
def test_shards(root, data_folder):
    """The shards of the test subset, prepared alone."""
    return prepare(
        pairs(root, data_folder, f"data.table={root / 'table.csv'}"), progress=False, subset="test"
    )


def test_only_the_asked_subset_is_rendered(test_shards):
    assert [source.object_id for source in test_shards.sources] == ["m5", "m6"]
    assert len(list(test_shards.folder.rglob("*.h5"))) == 2
    assert [(entry.object_id, entry.reason) for entry in test_shards.skipped] == [("m7", "is in no subset")]


def test_the_shard_knows_the_way_back_to_the_file(root, test_shards):
    with Shard(test_shards.paths[0]) as shard:
        back = shard.mesh.apply_transform(np.array(shard.facts["file_from_object"]))
        assert shard.facts["file"] == "m5.stl"
        assert shard.facts["status"] == "clean"
    np.testing.assert_allclose(back.bounds, trimesh.load_mesh(root / "mug" / "m5.stl").bounds, atol=1e-2)


def test_subsets_are_as_the_table_says(root, data_folder, test_shards, monkeypatch):
    monkeypatch.setattr(meshes_module, "ProcessPool", lambda *_, **__: pytest.fail("repaired again"))
    data = PairsDataModule(
        pairs(root, data_folder, f"data.table={root / 'table.csv'}"),
        evaluation_views=2,
        evaluation_points=100,
        evaluation_batch_size=2,
        progress=False,
    )
    assert {name: ids(data.subset(name)[0]) for name in ("train", "val", "test")} == {
        "train": ["m2", "m3"], "val": ["m4"], "test": ["m5", "m6"]
    }  # fmt: skip
    (batch,) = data.val_dataloader()
    assert {view.object_id for view in batch.ids} == {"m4"}


def test_objects_that_are_listed_already_are_not_listed_again(root, data_folder, test_shards, monkeypatch):
    typed = pairs(root, data_folder, f"data.table={root / 'table.csv'}")
    objects = list_objects(typed, progress=False)
    monkeypatch.setattr(prepare_module, "list_objects", lambda *_: pytest.fail("listed again"))
    data = PairsDataModule(typed, 2, 100, 2, progress=False, only="test", objects=objects)
    assert ids(data.subset("test")[0]) == ["m5", "m6"]
    assert [file.object_id for file in data.prepared.skipped] == ["m7"]


def test_training_without_objects_is_one_line(root, data_folder, test_shards, tmp_path):
    (tmp_path / "table.csv").write_text("file,category,subset\nmug/m5.stl,mug,test\n")
    data = PairsDataModule(
        pairs(root, data_folder, f"data.table={tmp_path / 'table.csv'}"), 2, 100, 2, progress=False
    )
    with pytest.raises(
        UserError, match=r"no object is in val, by data.fractions=\[.*; change these for a training"
    ):
        data.val_dataloader()


def test_the_commands_report_on_every_mesh(root, tmp_path):
    """A folder with a good, an open, a flat and a broken mesh: inspected, and rendered without the bad ones."""
    folder = tmp_path / "meshes"
    put(box(1, 1, 2), folder, "mug/good.ply")
    painted = box(1, 1, 2)
    painted.visual.vertex_colors = [200, 30, 30, 255]
    put(painted, folder, "mug/same.ply")
    lidless = box(1, 2, 1)
    lidless.update_faces(np.arange(12) > 0)
    put(lidless, folder, "bowl/open.ply")
    put(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), folder, "bowl/flat.ply")
    (folder / "bowl" / "noise.glb").write_bytes(b"\0" * 100)
    overrides = ["data.root=meshes", "paths.data=data", "workers=1"]
    done = program("-m", "stereo_occ.inspect", *overrides, "hydra.run.dir=report", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rendering = ["data=meshes", *overrides, "data.image_side=32", "data.views=1", "data.pool_size=100"]
    rendered = program("-m", "stereo_occ.render", *rendering, "hydra.run.dir=log", cwd=tmp_path)
    assert rendered.returncode == 0, rendered.stderr
    assert "2 objects in data/meshes_32px" in rendered.stdout
    (shards,) = (tmp_path / "data").glob("meshes_32px*")
    for report in (tmp_path / "report", shards):
        with (report / "quality.csv").open() as file:
            rows = {row["file"]: row for row in csv.DictReader(file)}
        assert {name: row["status"] for name, row in rows.items()} == {
            "bowl/flat.ply": "rejected", "bowl/noise.glb": "rejected", "bowl/open.ply": "repaired",
            "mug/good.ply": "clean", "mug/same.ply": "rejected",
        }  # fmt: skip
        assert rows["mug/same.ply"]["reason"] == "is a copy of mug/good"
        assert rows["bowl/noise.glb"]["reason"].startswith("cannot be read")
        assert float(rows["mug/good.ply"]["wall_median"]) > 0.3
        with Image.open(report / "quality.png") as sheet:
            assert len(np.unique(np.asarray(sheet.convert("RGB")).reshape(-1, 3), axis=0)) > 20
    # the table can be given back, with the subsets filled in
    table = (shards / "quality.csv").read_text()
    (tmp_path / "fixed.csv").write_text(table)
    again = program(
        "-m", "stereo_occ.inspect", *overrides, "data.table=fixed.csv", "hydra.run.dir=again", cwd=tmp_path
    )
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again" / "quality.csv").read_text() == table
