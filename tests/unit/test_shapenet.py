"""A small tree in the layout of ShapeNetCore, with the defects that its meshes have."""

import numpy as np
import pytest
import trimesh
from mesh_files import shapes_of, sheet_of

from stereo_occ.errors import UserError
from stereo_occ.shapes.shapenet import list_shapenet

#: Where each version keeps a model, by category.
PLACES = {
    1: {"mug": "03797390/{}/model.obj", "bowl": "02880940/{}/model.obj", "bottle": "02876657/{}/model.obj"},
    2: {
        "mug": "03797390/{}/models/model_normalized.obj",
        "bowl": "02880940/{}/models/model_normalized.obj",
        "bottle": "02876657/{}/models/model_normalized.obj",
    },
}


def add(root, version, category, model_id, mesh=None):
    """Write a model as ShapeNet does: its material library is named but missing."""
    path = root / PLACES[version][category].format(model_id)
    path.parent.mkdir(parents=True)
    mesh = trimesh.creation.box((1, 2, 1)) if mesh is None else mesh
    text = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file_type="obj")
    path.write_text(f"mtllib {path.stem}.mtl\nusemtl material_0_24\n{text}")
    return path


def lists(root, synset, **subsets):
    folder = root / "splits" / synset
    folder.mkdir(parents=True)
    for name, ids in subsets.items():
        (folder / f"{name}.lst").write_text("\n".join(ids) + "\n")
    return folder


def keys(listing):
    return [(file.category, file.object_id, file.subset) for file in listing.files]


@pytest.mark.parametrize("version", [1, 2])
def test_models_are_found_under_the_lemmas_of_their_synsets(tmp_path, version):
    for category in ("mug", "bowl", "bottle"):
        add(tmp_path, version, category, f"{category}1")
    (tmp_path / "02691156" / "plane").mkdir(parents=True)  # airplanes
    (tmp_path / "taxonomy.json").write_text("[]")
    listing = list_shapenet(tmp_path)
    assert keys(listing) == [("bottle", "bottle1", ""), ("bowl", "bowl1", ""), ("mug", "mug1", "")]
    assert listing.skipped == []
    shapes, rejected = shapes_of(tmp_path, listing)
    assert len(shapes) == 3
    assert rejected == {}
    assert all(shape.colors is None for shape in shapes)


@pytest.mark.parametrize("folder", ["splits/03797390", "splits/mug", "03797390"])
def test_lists_divide_a_category_and_leave_out_what_they_do_not_name(tmp_path, folder):
    for model_id in ("a", "b", "c", "d"):
        add(tmp_path, 2, "mug", model_id)
    add(tmp_path, 2, "bowl", "e")
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    for subset, ids in (("train", "b"), ("val", "c\n"), ("test", "a\r\nlost\n")):
        (tmp_path / folder / f"{subset}.lst").write_text(ids)
    listing = list_shapenet(tmp_path)
    assert keys(listing) == [
        ("bowl", "e", ""), ("mug", "a", "test"), ("mug", "b", "train"), ("mug", "c", "val")
    ]  # fmt: skip
    assert {entry.object_id: entry.reason for entry in listing.skipped} == {
        "d": "is in no list of the splits",
        "lost": "is in test.lst, but the folder is not there",
    }


def test_a_model_in_two_lists_is_an_error_of_one_line(tmp_path):
    add(tmp_path, 2, "mug", "a")
    folder = lists(tmp_path, "03797390", train=["a", "b"], test=["c", "a"])
    with pytest.raises(UserError) as caught:
        list_shapenet(tmp_path)
    assert str(caught.value) == (
        f"{folder / 'test.lst'}: a is in train.lst too; an object belongs to one subset"
    )


def test_a_model_without_its_mesh_is_skipped(tmp_path):
    (tmp_path / "03797390" / "hollow" / "models").mkdir(parents=True)
    (skipped,) = list_shapenet(tmp_path).skipped
    assert skipped.object_id == "hollow"
    assert skipped.reason == "has neither models/model_normalized.obj nor model.obj"


def test_a_folder_that_is_not_shapenet_says_where_to_look(tmp_path):
    add(tmp_path / "ShapeNetCore.v2", 2, "mug", "a")
    with pytest.raises(UserError, match=r"a level deeper; say data.root=.*/ShapeNetCore.v2"):
        list_shapenet(tmp_path)
    with pytest.raises(UserError, match=r"holds none of 02876657 \(bottle\).*data=meshes"):
        list_shapenet(tmp_path / "ShapeNetCore.v2" / "03797390")
    with pytest.raises(UserError, match=r"nowhere: no such folder"):
        list_shapenet(tmp_path / "nowhere")


def cup():
    """A round vessel open at +Y, its wall 5 % of its width."""
    outer = trimesh.creation.cylinder(0.5, 1.0, sections=24)
    inner = trimesh.creation.cylinder(0.45, 1.0, sections=24).apply_translation([0, 0, 0.05])
    return outer.difference(inner).apply_transform(
        trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    )


def test_the_defects_of_shapenet(tmp_path):
    """Doubled faces, flipped normals, missing materials, thousands of specks; and a wall without thickness."""
    solid = cup()
    sheet = trimesh.creation.uv_sphere(0.5, count=[16, 16])
    sheet.update_faces(sheet.triangles_center[:, 1] < 0)
    add(tmp_path, 2, "mug", "doubled", sheet_of(solid, np.random.default_rng(0), specks=3000))
    add(tmp_path, 2, "bowl", "sheet", sheet_of(sheet, np.random.default_rng(1), specks=0))
    shapes, rejected = shapes_of(tmp_path, list_shapenet(tmp_path))
    assert rejected == {}
    for shape in shapes:
        assert shape.mesh.is_volume
        assert shape.facts["status"] == "repaired"
    bowl, mug = sorted(shapes, key=lambda shape: shape.category)
    scale = np.linalg.norm(np.ptp(solid.bounds, axis=0))
    assert mug.mesh.volume == pytest.approx(solid.volume / scale**3, rel=0.25)
    middle = [[0, 0.1, 0]]
    assert not bowl.mesh.contains(middle)[0], "the sheet got thickness, it was not filled"
    assert not mug.mesh.contains([[0, 0.1, 0]])[0]
