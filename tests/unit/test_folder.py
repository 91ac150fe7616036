"""Meshes from a folder: what is accepted, what is skipped and why."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from stereo_occ.errors import UserError
from stereo_occ.shapes.folder import read_folder

REAL = Path(__file__).parents[3] / "shared" / "real_objects"


def put(mesh, root, place):
    path = root / place
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".gltf":
        for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh)).items():
            (path.parent / name).write_bytes(content)
    else:
        mesh.export(path)
    return path


def box(x, y, z):
    return trimesh.creation.box((x, y, z))


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb", "gltf"])
def test_every_format_gives_the_same_solid_in_the_object_frame(tmp_path, suffix):
    put(box(3, 4, 12).apply_translation([5, 6, 7]), tmp_path, f"bottle/carton/model.{suffix}")
    (shape,), skipped = read_folder(tmp_path)
    assert skipped == []
    assert (shape.category, shape.object_id) == ("bottle", "carton")
    np.testing.assert_allclose(
        shape.mesh.bounds, [[-3 / 26, -4 / 26, -12 / 26], [3 / 26, 4 / 26, 12 / 26]], atol=1e-6
    )
    assert shape.mesh.volume == pytest.approx(144 / 13**3, rel=1e-5)
    assert len(shape.mesh.vertices) == 8


def test_vertices_split_by_normals_and_texture_coordinates_are_merged(tmp_path):
    faces = "\n".join(
        f"f {a}/1/{n} {b}/2/{n} {c}/3/{n}" for n, (a, b, c) in enumerate(box(1, 1, 1).faces + 1, start=1)
    )
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in box(1, 1, 1).vertices)
    normals = "\n".join(f"vn 0 {n} 1" for n in range(1, 13))
    text = f"mtllib absent.mtl\n{vertices}\nvt 0 0\nvt 1 0\nvt 0 1\n{normals}\nusemtl absent\n{faces}\n"
    (tmp_path / "mug" / "a").mkdir(parents=True)
    (tmp_path / "mug" / "a" / "model.obj").write_text(text)
    (shape,), skipped = read_folder(tmp_path)
    assert skipped == []
    assert shape.mesh.is_watertight
    assert len(shape.mesh.vertices) == 8


def test_inside_out_meshes_are_turned_and_mixed_winding_is_made_consistent(tmp_path):
    inverted = box(1, 2, 3)
    inverted.invert()
    put(inverted, tmp_path, "bowl/inverted/model.ply")
    mixed = box(1, 2, 3)
    mixed.faces[:5] = mixed.faces[:5, ::-1]
    put(mixed, tmp_path, "bowl/mixed/model.ply")
    shapes, skipped = read_folder(tmp_path)
    assert skipped == []
    for shape in shapes:
        assert shape.mesh.is_winding_consistent
        assert shape.mesh.volume == pytest.approx(6 / 14**1.5, rel=1e-6)


def test_a_void_inside_stays_a_void(tmp_path):
    void = box(1, 1, 1)
    void.invert()
    put(trimesh.util.concatenate([box(2, 2, 2), void]), tmp_path, "bottle/hollow/model.stl")
    (shape,), _ = read_folder(tmp_path)
    assert shape.mesh.volume == pytest.approx((8 - 1) / 12**1.5, rel=1e-5)
    assert shape.facts["bodies"] == 2


def test_parts_of_a_scene_are_put_in_their_places(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(box(1, 1, 1))
    scene.add_geometry(box(1, 1, 1), transform=trimesh.transformations.translation_matrix([0, 3, 0]))
    put(scene, tmp_path, "mug/two/model.glb")
    (shape,), _ = read_folder(tmp_path)
    assert shape.mesh.extents[1] / shape.mesh.extents[0] == pytest.approx(4)
    assert shape.mesh.volume == pytest.approx(2 / 18**1.5, rel=1e-5)


def test_an_open_mesh_is_skipped_with_the_count_of_its_open_edges(tmp_path):
    lidless = box(1, 1, 1)
    lidless.update_faces(np.arange(12) > 0)
    path = put(lidless, tmp_path, "mug/open/model.off")
    shapes, (skipped,) = read_folder(tmp_path)
    assert shapes == []
    assert (skipped.path, skipped.object_id, skipped.category) == (path, "open", "mug")
    assert skipped.reason == "not watertight: of 18 edges 3 border a hole and 0 join more than two faces"


def test_touching_walls_are_skipped_with_the_count_of_their_shared_edges(tmp_path):
    pair = trimesh.util.concatenate([box(1, 1, 1), box(1, 1, 1).apply_translation([1, 1, 0])])
    put(pair, tmp_path, "mug/pair/model.ply")
    _, (skipped,) = read_folder(tmp_path)
    assert "0 border a hole and 1 join more than two faces" in skipped.reason


def test_a_flat_sheet_with_two_sides_encloses_no_volume(tmp_path):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0]]
    sheet = trimesh.Trimesh(corners, [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]], process=False)
    put(sheet, tmp_path, "bowl/sheet/model.ply")
    _, (skipped,) = read_folder(tmp_path)
    assert skipped.reason.startswith("encloses no volume")


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb", "gltf"])
@pytest.mark.parametrize("damage", ["truncated", "empty", "noise"])
def test_a_broken_file_is_skipped_and_the_others_are_read(tmp_path, suffix, damage):
    put(box(1, 2, 3), tmp_path, "mug/good/model.stl")
    path = put(box(1, 2, 3), tmp_path, f"mug/bad/model.{suffix}")
    whole = path.read_bytes()
    noise = np.random.default_rng(0).bytes(500)
    path.write_bytes({"truncated": whole[: len(whole) // 2], "empty": b"", "noise": noise}[damage])
    shapes, (skipped,) = read_folder(tmp_path)
    assert [shape.object_id for shape in shapes] == ["good"]
    assert skipped.object_id == "bad"
    assert skipped.reason
    assert "\n" not in skipped.reason


def test_collada_is_skipped_with_the_package_it_needs(tmp_path):
    if "dae" in trimesh.available_formats():
        pytest.skip("pycollada is installed")
    (tmp_path / "mug" / "old").mkdir(parents=True)
    (tmp_path / "mug" / "old" / "model.dae").write_text("<COLLADA/>")
    _, (skipped,) = read_folder(tmp_path)
    assert "pycollada" in skipped.reason


def test_misplaced_and_misnamed_files_say_where_they_belong(tmp_path):
    put(box(1, 1, 1), tmp_path, "mug/loose.stl")
    put(box(1, 1, 1), tmp_path, "mug/other/thing.stl")
    (tmp_path / "mug" / "void").mkdir()
    (tmp_path / "mug" / "notes.txt").write_text("not a mesh")
    shapes, skipped = read_folder(tmp_path)
    assert shapes == []
    reasons = {entry.object_id: entry.reason for entry in skipped}
    assert set(reasons) == {"loose.stl", "other", "void"}
    assert "loose/model.stl" in reasons["loose.stl"]
    assert "rename thing.stl to model.stl" in reasons["other"]
    assert "no file model.*" in reasons["void"]


def test_an_unknown_category_is_skipped_and_the_nearest_one_named(tmp_path):
    put(box(1, 1, 1), tmp_path, "mug/a/model.stl")
    put(box(1, 1, 1), tmp_path, "Bottles/b/model.stl")
    shapes, (skipped,) = read_folder(tmp_path)
    assert [shape.object_id for shape in shapes] == ["a"]
    assert (skipped.category, skipped.object_id) == ("Bottles", "")
    assert "rename it to bottle" in skipped.reason


def test_a_missing_folder_and_one_without_categories_name_the_folder_and_the_layout(tmp_path):
    with pytest.raises(UserError, match=r"nowhere does not exist.*CATEGORY/NAME/model"):
        read_folder(tmp_path / "nowhere")
    (tmp_path / "cups").mkdir()
    with pytest.raises(UserError, match=r"holds no category \(cups\).*CATEGORY/NAME/model"):
        read_folder(tmp_path)


@pytest.mark.skipif(not REAL.is_dir(), reason="the folder of real objects is not here")
def test_real_objects_are_read_or_skipped_as_their_catalogue_says():
    shapes, skipped = read_folder(REAL)
    rows = [line.split(",") for line in (REAL / "CATALOG.csv").read_text().splitlines()[1:]]
    watertight = {(row[0], row[1]) for row in rows if row[-2] == "True"}
    assert {(shape.category, shape.object_id) for shape in shapes} == watertight
    assert len(shapes) + len(skipped) == len(rows)
    assert all(shape.mesh.is_volume for shape in shapes)
