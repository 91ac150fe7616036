"""Mesh files of every format: the same solid, in the object frame, with its colours and the way back."""

import json
import re

import numpy as np
import pytest
import trimesh
from mesh_files import box, put, shapes_of
from PIL import Image
from samples import single_line
from scipy.spatial import cKDTree

from stereo_occ.errors import UserError
from stereo_occ.shapes import gltf as gltf_module
from stereo_occ.shapes.inspection import inspect_mesh
from stereo_occ.shapes.layouts import UpAxis, list_folder
from stereo_occ.shapes.mesh_cache import MeshCache, load
from stereo_occ.shapes.reading import read_mesh

FORMATS = ["obj", "ply", "stl", "off", "glb", "gltf", "dae"]


def read_folder(root, colors=True):
    return shapes_of(root, list_folder(root), colors)


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_gives_the_same_solid_in_the_object_frame(tmp_path, suffix):
    put(box(3, 4, 12).apply_translation([5, 6, 7]), tmp_path, f"bottle/carton/model.{suffix}")
    (shape,), rejected = read_folder(tmp_path)
    assert rejected == {}
    assert (shape.category, shape.object_id) == ("bottle", "carton")
    np.testing.assert_allclose(
        shape.mesh.bounds, [[-3 / 26, -4 / 26, -12 / 26], [3 / 26, 4 / 26, 12 / 26]], atol=1e-6
    )
    assert shape.mesh.volume == pytest.approx(144 / 13**3, rel=1e-5)
    assert len(shape.mesh.vertices) == 8


@pytest.mark.parametrize("place", ["mug/name/model.gltf", "mug/name.gltf"])
def test_the_way_back_to_the_files_own_frame_is_kept(tmp_path, place):
    mesh = trimesh.creation.icosphere(subdivisions=1).apply_transform(np.diag([300, 20, 100, 1]))
    put(mesh.apply_translation([1000, -50, 7]), tmp_path, place)
    (shape,), _ = read_folder(tmp_path)
    np.testing.assert_allclose(shape.mesh.bounds.mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(np.ptp(shape.mesh.bounds, axis=0)) == pytest.approx(1)
    back = shape.mesh.copy().apply_transform(np.array(shape.facts["file_from_object"]))
    np.testing.assert_allclose(back.bounds, mesh.bounds, rtol=1e-6)
    assert back.volume == pytest.approx(mesh.volume, rel=1e-5)


def test_an_object_of_a_file_with_z_up_stands_and_knows_the_way_back(tmp_path):
    cone = trimesh.creation.cone(radius=0.5, height=3)  # its tip at +Z
    put(cone.apply_translation([4, 5, 6]), tmp_path, "bottle/cone.stl")
    (shape,), _ = shapes_of(tmp_path, list_folder(tmp_path, UpAxis.z))
    assert shape.mesh.extents.argmax() == 1
    assert shape.mesh.center_mass[1] < 0, "the base is below, where most of the volume is"
    assert shape.mesh.volume == pytest.approx(cone.volume / np.linalg.norm(cone.extents) ** 3, rel=1e-5)
    back = shape.mesh.copy().apply_transform(np.array(shape.facts["file_from_object"]))
    assert cKDTree(back.vertices).query(cone.vertices)[0].max() < 1e-5


def test_vertices_split_by_normals_and_texture_coordinates_are_merged(tmp_path):
    faces = "\n".join(
        f"f {a}/1/{n} {b}/2/{n} {c}/3/{n}" for n, (a, b, c) in enumerate(box(1, 1, 1).faces + 1, start=1)
    )
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in box(1, 1, 1).vertices)
    normals = "\n".join(f"vn 0 {n} 1" for n in range(1, 13))
    text = f"mtllib absent.mtl\n{vertices}\nvt 0 0\nvt 1 0\nvt 0 1\n{normals}\nusemtl absent\n{faces}\n"
    (tmp_path / "model.obj").write_text(text)
    inspection = inspect_mesh(tmp_path / "model.obj", tmp_path, colors=True)
    assert inspection.status == "clean"
    assert len(inspection.mesh.vertices) == 8
    assert inspection.colors is None, "a material that is missing is no colour"


@pytest.mark.parametrize("suffix", ["glb", "gltf", "dae"])
def test_parts_of_a_scene_are_put_in_their_places(tmp_path, suffix):
    scene = trimesh.Scene()
    scene.add_geometry(box(1, 1, 1), node_name="a")
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1]) @ np.diag([2.0, 1, 1, 1])
    turned[:3, 3] = 0, 5, 0
    scene.add_geometry(box(1, 1, 1), node_name="b", transform=turned)
    if suffix == "dae":
        path = put(box(1, 1, 1), tmp_path, "model.dae")
        node = re.search(r"<node.*</node>", path.read_text(), flags=re.DOTALL).group()
        matrix = f"<matrix>{' '.join(map(str, turned.ravel()))}</matrix>"
        moved = re.sub(r"(<node[^>]*)>", rf'\1 id="b">{matrix}', node.replace('id="node0"', ""))
        path.write_text(path.read_text().replace(node, node + moved))
    else:
        path = put(scene, tmp_path, f"model.{suffix}")
    mesh = read_mesh(path, tmp_path, colors=False).mesh
    assert sorted(np.ptp(mesh.vertices, axis=0)) == pytest.approx([1, 1, 6.5])
    assert mesh.volume == pytest.approx(3)
    assert mesh.body_count == 2


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("damage", ["truncated", "empty", "noise"])
def test_a_broken_file_is_one_line(tmp_path, suffix, damage):
    path = put(box(1, 2, 3), tmp_path, f"model.{suffix}")
    whole = path.read_bytes()
    noise = np.random.default_rng(0).bytes(500)
    path.write_bytes({"truncated": whole[: len(whole) // 2], "empty": b"", "noise": noise}[damage])
    with pytest.raises(UserError) as caught:
        read_mesh(path, tmp_path, colors=True)
    assert single_line(str(caught.value))


def test_collada_without_its_package_names_it(tmp_path, monkeypatch):
    monkeypatch.setattr(trimesh, "available_formats", lambda: {"obj", "stl"})
    inspection = inspect_mesh(tmp_path / "model.dae", tmp_path, colors=True)
    assert "pip install 'pycollada" in inspection.reason


def painted(root, colors):
    """A textured box: the halves of its picture are red and blue, and u runs along X."""
    mesh = box(1, 1, 1).subdivide()
    uv = np.stack([mesh.vertices[:, 0] + 0.5, np.full(len(mesh.vertices), 0.5)], axis=1)
    picture = Image.fromarray(np.repeat(np.array([[[255, 0, 0], [0, 0, 255]]], np.uint8), 8, axis=1))
    mesh.visual = trimesh.visual.TextureVisuals(uv, image=picture)
    path = put(mesh, root, "model.obj")
    return inspect_mesh(path, root, colors)


def test_textures_become_colours_of_the_vertices(tmp_path):
    inspection = painted(tmp_path, colors=True)
    vertices, colors = inspection.mesh.vertices, inspection.colors
    assert colors.shape == vertices.shape
    assert (colors[vertices[:, 0] < -0.1] == [255, 0, 0]).all()
    assert (colors[vertices[:, 0] > 0.1] == [0, 0, 255]).all()
    assert painted(tmp_path, colors=False).colors is None


def test_colours_of_materials_and_vertices(tmp_path):
    mesh = box(1, 1, 1)
    mesh.visual.vertex_colors = [10, 200, 30, 255]
    for suffix in ("ply", "obj"):
        inspection = inspect_mesh(put(mesh, tmp_path, f"model.{suffix}"), tmp_path, colors=True)
        np.testing.assert_array_equal(inspection.colors, np.tile([10, 200, 30], (8, 1)))
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0.5, 0.0, 1.0, 1.0])
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=material)
    inspection = inspect_mesh(put(mesh, tmp_path, "model.glb"), tmp_path, colors=True)
    # glTF states colours in linear light: half of it is 188 of 255 on a screen
    np.testing.assert_allclose(inspection.colors, np.tile([188, 0, 255], (8, 1)), atol=1)
    plain = inspect_mesh(put(box(1, 1, 1), tmp_path, "plain.ply"), tmp_path, colors=True)
    assert plain.colors is None


def textured_obj(root, line):
    """A textured box whose MTL names its texture in that way; the texture is tex.png beside it."""
    painted(root, colors=False)
    (picture,) = root.glob("*.png")
    picture.rename(root / "tex.png")
    (material,) = root.glob("*.mtl")
    material.write_text(f"newmtl {material_name(root)}\nKd 1 1 1\nmap_Kd {line}\n")
    return root / "model.obj"


def material_name(root):
    return re.search(r"usemtl (\S+)", (root / "model.obj").read_text()).group(1)


@pytest.mark.parametrize(
    "line",
    ["tex.png", "C:\\\\Users\\\\bob\\\\tex.png", "/home/bob/tex.png", "-s 1 1 1 tex.png", "maps/tex.png"],
)
def test_textures_are_found_beside_the_model_by_the_name_alone(tmp_path, line):
    raw = read_mesh(textured_obj(tmp_path, line), tmp_path, colors=True)
    assert {tuple(color) for color in raw.colors.colors_N3} == {(255, 0, 0), (0, 0, 255)}
    assert raw.lost == ()


def test_a_texture_that_is_not_there_is_said(tmp_path):
    path = textured_obj(tmp_path, "other.png")
    assert inspect_mesh(path, tmp_path, colors=True).lost == ("other.png is not there",)


def gltf(root, mesh, **changes):
    """A glTF file with its buffers beside it; changes replace parts of its JSON."""
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh)).items():
        if name == "model.gltf":
            content = json.dumps(json.loads(content) | changes).encode()
        (root / name).write_bytes(content)
    return root / "model.gltf"


def test_names_in_gltf_are_escaped(tmp_path):
    path = gltf(tmp_path, box(1, 2, 3))
    for buffer in tmp_path.glob("*.bin"):
        path.write_text(path.read_text().replace(buffer.name, "my%20" + buffer.name))
        buffer.rename(tmp_path / f"my {buffer.name}")
    assert read_mesh(path, tmp_path, colors=True).mesh.volume == pytest.approx(6)


@pytest.mark.parametrize(
    ("extension", "reason"),
    [
        ("KHR_draco_mesh_compression", "is compressed .*pip install DracoPy"),
        ("EXT_meshopt_compression", "is compressed .*export it without"),
    ],
)
def test_compressed_gltf_is_named(tmp_path, extension, reason, monkeypatch):
    monkeypatch.setattr(gltf_module, "find_spec", lambda name: None)
    path = gltf(tmp_path, box(1, 1, 1), extensionsUsed=[extension], extensionsRequired=[extension])
    with pytest.raises(UserError, match=reason):
        read_mesh(path, tmp_path, colors=False)


@pytest.mark.parametrize("suffix", ["gltf", "glb"])
def test_places_as_fractions_are_refused_and_not_misread(tmp_path, suffix):
    path = gltf(tmp_path, box(1, 1, 1))
    scene = json.loads(path.read_text())
    place = scene["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    scene["accessors"][place]["normalized"] = True
    if suffix == "gltf":
        path.write_text(json.dumps(scene))
    else:
        text = json.dumps(scene).encode()
        path = tmp_path / "model.glb"
        sizes = (20 + len(text)).to_bytes(4, "little"), len(text).to_bytes(4, "little")
        path.write_bytes(b"glTF\x02\0\0\0" + sizes[0] + sizes[1] + b"JSON" + text)
    with pytest.raises(UserError, match="normalised integers, which are not read"):
        read_mesh(path, tmp_path, colors=False)


def test_gltf_multiplies_textures_factors_and_vertex_colours_in_linear_light(tmp_path):
    mesh = box(1, 1, 1)
    red, plain = [255, 0, 0, 255], {"pbrMetallicRoughness": {"metallicFactor": 0.0}}
    mesh.visual.vertex_colors = red

    def colors(**changes):
        raw = read_mesh(gltf(tmp_path, mesh, **changes), tmp_path, colors=True)
        return np.unique(raw.colors.colors_N3, axis=0).tolist()

    def with_material(material):
        path = gltf(tmp_path, mesh)
        scene = json.loads(path.read_text())
        scene["meshes"][0]["primitives"][0]["material"] = 0
        return colors(materials=[material], meshes=scene["meshes"])

    assert colors() == [[255, 0, 0]]
    assert with_material(plain) == [[255, 0, 0]]
    half = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]}}
    assert with_material(half) == [[188, 0, 0]]  # half of the light
    mesh = box(1, 1, 1)
    assert with_material(plain) == [[255, 255, 255]]
    picture = Image.new("RGB", (4, 4), (0, 255, 0))
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=picture, baseColorFactor=[51, 51, 51, 255]
    )
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.full((8, 2), 0.5), material=material)
    ((r, g, b),) = colors()
    assert (r, b) == (0, 0)
    assert g == pytest.approx(124, abs=1)  # a fifth of the light


def test_materials_and_textures_outside_the_data_set_are_not_read(tmp_path):
    (tmp_path / "outside.mtl").write_text("newmtl red\nKd 1 0 0\n")
    root = tmp_path / "root"
    text = "mtllib ../outside.mtl\nusemtl red\n" + box(1, 1, 1).export(file_type="obj")
    (root / "inner").mkdir(parents=True)
    (root / "inner" / "model.obj").write_text(text.replace("../", "../../"))
    raw = read_mesh(root / "inner" / "model.obj", root, colors=True)
    assert raw.side_files == {"../../outside.mtl": "", "outside.mtl": ""}
    assert raw.lost == ("../../outside.mtl is not there",)
    (root / "outside.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (root / "inner" / "model.obj").write_text(text)
    raw = read_mesh(root / "inner" / "model.obj", root, colors=True)
    assert list(raw.side_files) == ["../outside.mtl"]
    assert len(raw.side_files["../outside.mtl"]) == 64


def test_a_broken_picture_costs_the_colours_alone(tmp_path):
    painted(tmp_path, colors=True)
    for picture in tmp_path.glob("*.png"):
        picture.write_bytes(picture.read_bytes()[:40])
    inspection = inspect_mesh(tmp_path / "model.obj", tmp_path, colors=True)
    assert inspection.reason == ""
    assert inspection.mesh.is_volume
    assert inspection.lost == ("material_0.png is no sound picture",)


@pytest.mark.parametrize("kept", [40, 4000])
def test_colours_come_back_with_the_picture(tmp_path, kept):
    """The entry of a model whose texture was broken, in its head or later, does not outlive the texture's repair."""
    path = textured_obj(tmp_path, "tex.png")
    noise = np.random.default_rng(0).integers(0, 2, (64, 64, 3), np.uint8) * [255, 0, 0]
    Image.fromarray(noise.astype(np.uint8)).resize((256, 256)).save(tmp_path / "tex.png")
    whole = (tmp_path / "tex.png").read_bytes()
    (tmp_path / "tex.png").write_bytes(whole[:kept])
    cache = MeshCache(tmp_path / "cache", tmp_path, colors=True)
    assert "tex.png is no sound picture" in load(cache.make(path)).lost
    (tmp_path / "tex.png").write_bytes(whole)
    assert cache.find(path) is None
    assert load(cache.make(path)).colors[:, 1:].max() == 0
    assert load(cache.find(path)).lost == ()
