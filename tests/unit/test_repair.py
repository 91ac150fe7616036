"""Every defect that meshes come with: what is made of it, and that it stays the object it is."""

from importlib import import_module

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

import stereo_occ.shapes.repair as package
from stereo_occ.errors import UserError
from stereo_occ.occupancy.contains import contains
from stereo_occ.occupancy.enclosure import overlap
from stereo_occ.shapes.distance import Surface
from stereo_occ.shapes.repair import repair


@pytest.fixture(autouse=True)
def _coarse(monkeypatch):
    """Half the resolution, for speed."""
    monkeypatch.setattr(import_module("stereo_occ.shapes.repair.wrap"), "CELLS", 128)


def box(*extents, at=(0, 0, 0)):
    return trimesh.creation.box(extents).apply_translation(at)


def joined(*meshes):
    return trimesh.util.concatenate(meshes)


def inverted(mesh):
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def tube(path_P3, radius, sections=12, capped=True):
    """A tube along a curve in the xz-plane."""
    tangent_P3 = np.gradient(path_P3, axis=0)
    tangent_P3 /= np.linalg.norm(tangent_P3, axis=1)[:, None]
    across_P3 = np.cross(tangent_P3, [0, 1, 0])
    turn_S = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    rings_PS3 = path_P3[:, None] + radius * (
        np.cos(turn_S)[:, None] * across_P3[:, None] + np.sin(turn_S)[:, None] * np.array([0, 1, 0])
    )
    index_PS = np.arange(rings_PS3.shape[0] * sections).reshape(-1, sections)
    a, b = index_PS[:-1], index_PS[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = [np.stack([a, a1, b], -1).reshape(-1, 3), np.stack([a1, b1, b], -1).reshape(-1, 3)]
    vertices = [rings_PS3.reshape(-1, 3)]
    if capped:
        vertices.append(path_P3[[0, -1]])
        for ring, centre, way in ((index_PS[0], index_PS.size, -1), (index_PS[-1], index_PS.size + 1, 1)):
            fan = np.stack([ring, np.roll(ring, -1), np.full(sections, centre)], -1)
            faces.append(fan[:, ::way])
    mesh = trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def cup(wall=0.06):
    """A closed mug's body, 1 high, and its radius."""
    profile = [[0, 0], [0.4, 0], [0.4, 1], [0.4 - wall, 1], [0.4 - wall, wall], [0, wall]]
    mesh = trimesh.creation.revolve(profile, sections=48)
    mesh.merge_vertices()
    return mesh


def sheet_cup():
    """A cup of one sheet without thickness, open at the top."""
    mesh = trimesh.creation.revolve([[0, 0], [0.4, 0], [0.4, 1]], sections=48)
    mesh.merge_vertices()
    return mesh.subdivide()


def scan_without_base(inside_too=False):
    """A cup on a turntable: no camera saw what it stood on, nor perhaps its bottom inside."""
    mesh = cup()
    lowest_F = mesh.triangles[:, :, 2].max(axis=1)
    kept_F = lowest_F > 1e-6
    if inside_too:
        kept_F &= (mesh.triangles[:, :, 2].min(axis=1) < 0.06 - 1e-6) | (lowest_F > 0.06 + 1e-6)
    mesh.update_faces(kept_F)
    mesh.remove_unreferenced_vertices()
    return mesh


def handle(capped=True):
    """A bow whose ends stick in the wall of the cup."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 24)
    path = np.stack([0.37 + 0.3 * np.cos(turn), 0 * turn, 0.5 + 0.3 * np.sin(turn)], axis=1)
    return tube(path, 0.02, capped=capped)


def check_solid(mesh):
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert overlap(mesh, RayMeshIntersector(mesh)) <= 2e-4


def test_a_clean_mesh_keeps_its_bytes():
    mesh = cup()
    result = repair(mesh)
    assert result.steps == ()
    assert result.mesh.vertices.tobytes() == mesh.vertices.tobytes()
    assert result.mesh.faces.tobytes() == mesh.faces.tobytes()
    assert result.measures["lost_p99"] < 1e-6
    assert result.measures["gained_p99"] < 1e-6


def test_a_clean_mesh_with_a_void_keeps_its_bytes():
    mesh = joined(box(1, 1, 2), inverted(box(0.8, 0.8, 1.6)))
    result = repair(mesh)
    assert result.steps == ()
    assert result.mesh.faces.tobytes() == mesh.faces.tobytes()
    assert result.measures["void"] == pytest.approx(0.8 * 0.8 * 1.6 / 2)


def test_unwelded_vertices():
    mesh = cup()
    loose = trimesh.Trimesh(
        mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False
    )
    result = repair(loose)
    assert result.steps == ("welded vertices",)
    assert result.mesh.volume == pytest.approx(mesh.volume)
    assert len(result.mesh.vertices) == len(mesh.vertices)


def test_vertices_that_nearly_meet():
    mesh = cup()
    points = mesh.triangles.reshape(-1, 3) + 2e-6 * np.random.default_rng(0).uniform(
        -1, 1, (3 * len(mesh.faces), 3)
    )
    result = repair(trimesh.Trimesh(points, np.arange(len(points)).reshape(-1, 3), process=False))
    check_solid(result.mesh)
    assert any("of the diagonal apart" in step for step in result.steps)
    assert result.mesh.volume == pytest.approx(mesh.volume, rel=1e-3)


def test_a_solid_of_back_to_back_faces():
    mesh = cup()
    result = repair(
        trimesh.Trimesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]), process=False)
    )
    check_solid(result.mesh)
    assert result.steps == (f"dropped {len(mesh.faces)} doubled faces",)
    assert result.mesh.volume == pytest.approx(mesh.volume)


def test_flaps_on_a_solid():
    mesh = cup()
    corners = mesh.faces[100]
    flap = np.array([[corners[0], corners[1], len(mesh.vertices)]])
    vertices = np.concatenate(
        [mesh.vertices, mesh.triangles_center[None, 100] + 0.2 * mesh.face_normals[None, 100]]
    )
    faces = np.concatenate([mesh.faces, flap, flap[:, ::-1]])
    result = repair(trimesh.Trimesh(vertices, faces, process=False))
    assert result.steps == ("dropped 2 doubled faces",)
    assert result.mesh.volume == pytest.approx(mesh.volume)


@pytest.mark.parametrize("flipped", ["all", "some"])
def test_flipped_faces(flipped):
    mesh = cup()
    faces = mesh.faces.copy()
    chosen = slice(None) if flipped == "all" else np.random.default_rng(0).random(len(faces)) < 0.4
    faces[chosen] = faces[chosen, ::-1]
    result = repair(trimesh.Trimesh(mesh.vertices, faces, process=False))
    check_solid(result.mesh)
    assert result.mesh.volume == pytest.approx(mesh.volume)
    assert len(result.mesh.faces) == len(mesh.faces)


def test_pin_holes():
    mesh = trimesh.creation.icosphere(subdivisions=5)
    keep = np.ones(len(mesh.faces), bool)
    keep[[7, 3000]] = False
    keep[mesh.vertex_faces[200][mesh.vertex_faces[200] >= 0]] = False  # a fan of six
    result = repair(trimesh.Trimesh(mesh.vertices, mesh.faces[keep], process=False))
    check_solid(result.mesh)
    assert "closed 3 pin-holes" in result.steps
    assert result.mesh.volume == pytest.approx(mesh.volume, rel=1e-4)


@pytest.mark.parametrize("sides", [1, 2])
def test_a_sheet_gets_thickness_and_the_cup_stays_hollow(sides):
    sheet = sheet_cup()
    faces = sheet.faces if sides == 1 else np.concatenate([sheet.faces, sheet.faces[:, ::-1]])
    result = repair(trimesh.Trimesh(sheet.vertices, faces, process=False))
    check_solid(result.mesh)
    assert result.steps[-2] == "wrapped"
    assert result.steps[-1].startswith("gave thickness to 100 %")
    assert not contains(result.mesh, np.array([[0, 0, 0.3], [0, 0, 0.9], [0.3, 0, 0.6]])).any()
    assert contains(result.mesh, np.array([[0.4, 0, 0.5], [0, 0, 0.0], [0, -0.4, 0.8]])).all()
    assert result.mesh.body_count == 1
    assert result.measures["cavity"] > 0.85
    assert result.measures["wall_median"] == pytest.approx(0.015, abs=0.002)
    assert result.measures["gained_p99"] < 0.012


def test_cup_and_handle_become_one_solid_without_inner_walls():
    result = repair(joined(cup(), handle()))
    check_solid(result.mesh)
    assert result.steps == ("joined 2 bodies",)
    assert (result.measures["bodies"], result.measures["genus"]) == (1, 1)
    union = trimesh.boolean.union([cup(), handle()])
    assert result.mesh.volume == pytest.approx(union.volume, rel=1e-6)
    assert result.measures["cavity"] > 0.5


def test_open_ends_of_a_handle_are_closed_where_they_stick_in_the_wall():
    result = repair(joined(cup(), handle(capped=False)))
    check_solid(result.mesh)
    assert result.steps == ("closed 2 ends within other parts", "joined 2 bodies")
    assert (result.measures["bodies"], result.measures["genus"]) == (1, 1)


@pytest.mark.parametrize("winding", ["inward", "outward", "mixed"])
@pytest.mark.parametrize("outer_inverted", [False, True])
def test_a_void_stays_a_void_however_it_is_wound(winding, outer_inverted):
    inner = trimesh.creation.icosphere(subdivisions=3, radius=0.9)
    if winding == "inward":
        inner.invert()
    elif winding == "mixed":
        inner.faces[::3] = inner.faces[::3, ::-1]
    outer = trimesh.creation.icosphere(subdivisions=3)
    result = repair(joined(inverted(outer) if outer_inverted else outer, inner))
    check_solid(result.mesh)
    assert result.mesh.volume == pytest.approx(outer.volume * (1 - 0.9**3))
    assert result.measures["void"] == pytest.approx(0.9**3, rel=1e-6)


def test_hidden_content_goes_and_the_vessel_stays_hollow():
    shell = joined(box(1, 1, 2), inverted(box(0.9, 0.9, 1.9)))
    result = repair(joined(shell, box(0.8, 0.8, 1.2, at=(0, 0, -0.2))))
    assert result.steps == ("dropped 1 bodies hidden inside",)
    assert result.mesh.volume == pytest.approx(2 - 0.9 * 0.9 * 1.9)


def test_content_in_the_solid_matters_as_little_as_it_is_seen():
    result = repair(joined(box(1, 1, 2), box(0.2, 0.2, 0.2)))
    assert result.mesh.volume == pytest.approx(2)


def test_an_inner_partition_goes():
    parts = joined(box(1, 1, 1), box(1, 1, 1, at=(0, 0, 1)))
    parts.merge_vertices()
    wall = np.isclose(parts.triangles_center[:, 2], 0.5)
    result = repair(
        trimesh.Trimesh(parts.vertices, parts.faces[~wall | (np.cumsum(wall) <= 2)], process=False)
    )
    check_solid(result.mesh)
    assert "dropped 1 inner partitions" in result.steps
    assert result.mesh.volume == pytest.approx(2)


def test_a_label_on_the_surface_goes():
    label = trimesh.creation.revolve([[0.403, 0.3], [0.403, 0.7]], sections=48)
    result = repair(joined(cup(), label))
    assert "dropped 1 sheets that lie on other parts" in result.steps
    assert result.mesh.volume == pytest.approx(cup().volume)


def test_thousands_of_specks_go():
    rng = np.random.default_rng(0)
    speck = trimesh.creation.icosahedron().apply_scale(2e-4)
    places = rng.uniform((-0.6, -0.6, -0.1), (0.6, 0.6, 1.1), (3000, 3))
    vertices = (places[:, None] + speck.vertices).reshape(-1, 3)
    faces = (12 * np.arange(3000)[:, None, None] + speck.faces).reshape(-1, 3)
    result = repair(joined(cup(), trimesh.Trimesh(vertices, faces, process=False)))
    assert "dropped 3000 specks" in result.steps
    assert result.mesh.volume == pytest.approx(cup().volume)


def test_a_cup_in_thousands_of_fragments_is_wrapped_and_stays_hollow():
    mesh = cup().subdivide_to_size(0.06)
    middle = mesh.triangles_center[:, None]
    apart = (middle + 0.96 * (mesh.triangles - middle)).reshape(-1, 3)
    assert len(apart) > 9000
    result = repair(trimesh.Trimesh(apart, np.arange(len(apart)).reshape(-1, 3), process=False))
    check_solid(result.mesh)
    assert result.steps == ("wrapped",)
    assert result.mesh.volume == pytest.approx(mesh.volume, rel=0.05)
    assert result.measures["cavity"] > 0.5
    assert result.measures["lost_p99"] < 0.005


def test_a_tube_that_crosses_itself():
    turn = np.linspace(-0.15 * np.pi, 1.15 * np.pi, 80)
    path = np.stack([np.sin(2 * turn), 0 * turn, 1.4 * np.sin(turn)], axis=1)
    mesh = tube(path, 0.2, sections=24)
    assert overlap(mesh, RayMeshIntersector(mesh)) > 1e-3
    result = repair(mesh)
    check_solid(result.mesh)
    assert result.steps == ("wrapped",)
    low, high = mesh.bounds
    points = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    clear = Surface(mesh, 0.005 * mesh.scale).distance(points)[0] > 0.005 * mesh.scale
    assert (contains(mesh, points) == contains(result.mesh, points))[clear].mean() > 0.999


def test_the_same_mesh_gives_the_same_bytes_and_its_place_and_size_do_not_matter():
    sheet = sheet_cup()
    first, second = repair(sheet.copy()).mesh, repair(sheet.copy()).mesh
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()
    moved = repair(sheet.copy().apply_scale(1000).apply_translation([5000, -3000, 100])).mesh
    assert moved.volume == pytest.approx(1e9 * first.volume, rel=1e-3)
    np.testing.assert_allclose((moved.bounds - [5000, -3000, 100]) / 1000, first.bounds, atol=1e-3)


@pytest.mark.parametrize(
    ("vertices", "faces", "reason"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "holds no triangles"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, np.nan]], [[0, 1, 2]], "not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "encloses no volume: it is flat"),
        (
            [[0, 0, 0], [1e200, 0, 0], [0, 1e200, 1e200]],
            [[0, 1, 2]],
            "has no shape that its numbers can hold",
        ),
        ([[1e9, 0, 0], [1e9, 1, 0], [1e9, 0, 1]], [[0, 1, 2]], "has no shape that its numbers can hold"),
        ([[0, 0, 0], [1, 1, 1], [0, 0, 0]], [[0, 1, 1]], "no triangle with three different corners"),
    ],
)
def test_what_is_no_object_is_refused_in_one_line(vertices, faces, reason):
    with pytest.raises(UserError, match=reason) as error:
        repair(trimesh.Trimesh(vertices, faces, process=False))
    assert "\n" not in str(error.value)


def test_too_many_faces_are_refused(monkeypatch):
    monkeypatch.setattr(package, "MAX_FACES", 11)
    with pytest.raises(UserError, match="has 12 faces, more than 11: simplify it"):
        repair(box(1, 1, 1))


def test_a_solid_too_far_from_the_mesh_is_refused(monkeypatch):
    monkeypatch.setattr(import_module("stereo_occ.shapes.repair.wrap"), "CELLS", 64)
    monkeypatch.setattr(package, "MAX_MEAN_DEVIATION", 1e-3)
    with pytest.raises(UserError, match=r"too far from it: .* of the diagonal .* \(at most 0.1\)"):
        repair(sheet_cup())


@pytest.mark.parametrize("inside_too", [False, True])
def test_a_scan_without_its_base_gets_one(inside_too):
    """Not two thin shells with air in the wall."""
    repaired = repair(scan_without_base(inside_too))
    check_solid(repaired.mesh)
    assert repaired.steps[-1] == f"closed {1 + inside_too} openings between the sides of the wall"
    assert repaired.mesh.volume == pytest.approx(cup().volume, rel=1e-6)
    assert repaired.measures["cavity"] > 0.5


def test_a_cup_of_one_sheet_is_not_closed_at_its_rim():
    assert any(step.startswith("gave thickness") for step in repair(sheet_cup()).steps)
