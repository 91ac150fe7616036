"""Procedural objects: solid, reproducible, of every kind, and as thick, open and holed as they say."""

import hashlib
import subprocess
import sys

import numpy as np
import pytest
from samples import PAPER_COUNTS

from stereo_occ.errors import UserError
from stereo_occ.shapes import bottle, bowl, mug
from stereo_occ.shapes.procedural import procedural_shape

SEED = 0
KINDS = {"mug": mug.BODIES, "bowl": tuple(bowl.KIND_ODDS), "bottle": tuple(bottle.KIND_ODDS)}


@pytest.fixture(scope="module")
def shapes():
    """As many objects as in the paper."""
    return {
        category: [procedural_shape(category, SEED, index) for index in range(count)]
        for category, count in PAPER_COUNTS.items()
    }


def distances(mesh, origin, directions):
    """Sorted distances of all hits of each ray."""
    directions = np.asarray(directions, float)
    origins = np.broadcast_to(origin, directions.shape)
    where, ray, _ = mesh.ray.intersects_location(origins, directions, multiple_hits=True)
    away = np.linalg.norm(where - origins[ray], axis=1)
    return [np.sort(away[ray == i]) for i in range(len(directions))]


def axis_x(mesh):
    """Where the vessel's axis is: its depth along Z is its diameter, and it has nothing on the side of -X."""
    (x_low, _, z_low), (_, _, z_high) = mesh.bounds
    return x_low + (z_high - z_low) / 2


def digest(shape):
    return hashlib.sha256(shape.mesh.vertices.tobytes() + shape.mesh.faces.tobytes()).hexdigest()


def test_objects_are_the_same_in_another_process():
    code = (
        "import hashlib; from stereo_occ.shapes.procedural import procedural_shape as make\n"
        "for c in ('mug', 'bowl', 'bottle'):\n"
        "    m = make(c, 3, 5).mesh; print(hashlib.sha256(m.vertices.tobytes() + m.faces.tobytes()).hexdigest())"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert other == [digest(procedural_shape(category, 3, 5)) for category in KINDS]


def test_objects_depend_on_seed_and_index_but_not_on_the_order_they_are_made_in():
    first = digest(procedural_shape("mug", 1, 2))
    assert digest(procedural_shape("mug", 1, 3)) != first
    assert digest(procedural_shape("mug", 2, 2)) != first
    assert digest(procedural_shape("mug", 1, 2)) == first


def test_unknown_category_is_named():
    with pytest.raises(UserError, match=r"'plate'.*mug, bowl, bottle"):
        procedural_shape("plate", 0, 0)


@pytest.mark.parametrize("category", KINDS)
def test_each_is_a_normalised_solid(shapes, category):
    for shape in shapes[category]:
        assert shape.mesh.is_watertight, shape.object_id
        assert shape.mesh.is_winding_consistent, shape.object_id
        assert shape.mesh.volume > 0, shape.object_id
        low, high = shape.mesh.bounds
        np.testing.assert_allclose(low + high, 0, atol=1e-9)
        assert np.linalg.norm(high - low) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("category", KINDS)
def test_every_kind_appears_within_the_papers_counts(shapes, category):
    assert {shape.facts["kind"] for shape in shapes[category]} == set(KINDS[category])


def test_every_handle_section_and_closure_appears(shapes):
    assert {shape.facts["handle"] for shape in shapes["mug"]} == {"C", "D", "ear", "square", "none"}
    assert {shape.facts["handle_section"] for shape in shapes["mug"]} == {"round", "oval", "flat", "none"}
    assert {"round", "oval", "rounded rectangle"} <= {shape.facts["section"] for shape in shapes["bottle"]}
    closures = {closure for odds in bottle.CLOSURES.values() for closure in odds}
    assert {shape.facts["closure"] for shape in shapes["bottle"]} == closures


def test_one_mug_in_ten_has_no_handle_and_most_bottles_are_solid(shapes):
    assert 0.06 < np.mean([shape.facts["handle"] == "none" for shape in shapes["mug"]]) < 0.2
    assert 0.1 < np.mean([shape.facts["hollow"] for shape in shapes["bottle"]]) < 0.35


@pytest.mark.parametrize("category", ["mug", "bowl"])
def test_walls_are_one_to_six_percent_of_the_longest_side_and_mostly_two_to_four(shapes, category):
    thickness = np.array([shape.facts["wall_thickness"] for shape in shapes[category]])
    assert thickness.min() > 0.01
    assert thickness.max() < 0.065
    assert np.mean((thickness > 0.02) & (thickness < 0.04)) > 0.5


def test_a_handle_makes_one_hole_and_a_closed_hollow_bottle_has_one_void(shapes):
    for shape in [*shapes["mug"], *shapes["bowl"], *shapes["bottle"]]:
        handles = int(shape.facts["handle"] != "none")
        voids = int(
            bool(shape.facts["hollow"]) and shape.facts.get("closure", "plain") not in ("plain", "lip")
        )
        assert shape.mesh.euler_number == 2 - 2 * handles + 2 * voids, (shape.object_id, shape.facts)
        assert shape.mesh.body_count == 1 + voids, (shape.object_id, shape.facts)


def test_the_wall_of_a_round_mug_is_as_thick_as_it_says(shapes):
    outward = np.array([-1.0, 0.0, 0.02])  # beside the seam of the lathe, away from the handle
    outward /= np.linalg.norm(outward)
    for shape in [shape for shape in shapes["mug"][::2] if shape.facts["section"] == "round"]:
        mesh = shape.mesh
        floor, top = shape.parts["floor"].bounds[1, 1], mesh.bounds[1, 1]
        measured = []
        for share in (0.35, 0.45, 0.55, 0.65):
            origin = np.array([[axis_x(mesh), floor + share * (top - floor), 0.0]])
            where, _, face = mesh.ray.intersects_location(origin, outward[None], multiple_hits=True)
            assert len(where) == 2
            slope = np.abs(mesh.face_normals[face] @ outward).mean()
            measured.append(np.linalg.norm(where[0] - where[1]) * slope)
        expected = shape.facts["wall_thickness"] * mesh.extents.max()
        assert np.median(measured) == pytest.approx(expected, rel=0.05), shape.facts


@pytest.mark.parametrize("category", ["mug", "bowl"])
def test_the_cavity_is_open_above_its_floor(shapes, category):
    for shape in shapes[category][::3]:
        mesh = shape.mesh
        floor = shape.parts["floor"].bounds[1, 1]
        inside = np.array([axis_x(mesh) if category == "mug" else 0.0, floor + 0.02, 0.001])
        assert not mesh.contains(inside[None])[0], shape.facts
        up, down = distances(mesh, inside, [[0, 1, 0], [0, -1, 0]])
        assert len(up) == 0, shape.facts
        assert down[0] == pytest.approx(0.02, abs=1e-3), shape.facts


def test_no_handle_pokes_into_the_cavity(shapes):
    """Seen from the axis the wall is as far on the side of the handle as on the other."""
    across = [[1, 0, 0.003], [-1, 0, 0.003]]
    for shape in [shape for shape in shapes["mug"][::2] if shape.facts["section"] == "round"]:
        floor, top = shape.parts["floor"].bounds[1, 1], shape.mesh.bounds[1, 1]
        for share in np.linspace(0.1, 0.9, 9):
            with_handle, without = distances(
                shape.mesh, [axis_x(shape.mesh), floor + share * (top - floor), 0], across
            )
            assert with_handle[0] == pytest.approx(without[0], abs=2e-3), shape.facts


@pytest.mark.parametrize("category", KINDS)
def test_parts_are_solids_within_the_object_and_named_for_the_labels(shapes, category):
    for shape in shapes[category][:60]:
        assert set(shape.parts) == {
            "floor",
            *(["handle"] if shape.facts["handle"] != "none" else []),
            *(["neck"] if category == "bottle" else []),
        }
        for part in shape.parts.values():
            assert part.is_watertight
            assert part.volume > 0
            assert np.all(part.bounds[0] >= shape.mesh.bounds[0] - 1e-9)
            assert np.all(part.bounds[1] <= shape.mesh.bounds[1] + 1e-9)


@pytest.mark.parametrize("category", ["mug", "bottle"])
def test_the_handle_is_solid_and_lies_outside_the_body(shapes, category):
    rng = np.random.default_rng(0)
    for shape in [shape for shape in shapes[category] if "handle" in shape.parts][:20]:
        handle = shape.parts["handle"]
        points = rng.uniform(*handle.bounds, (3000, 3))
        points = points[handle.contains(points)]
        assert len(points) > 100
        assert shape.mesh.contains(points).mean() > 0.98, shape.facts
        assert np.abs(points[:, 2]).max() < 0.3


def test_handle_is_first_among_the_parts_so_that_no_slab_claims_it(shapes):
    for shape in [*shapes["mug"], *shapes["bottle"]]:
        if "handle" in shape.parts:
            assert next(iter(shape.parts)) == "handle"


def test_faces_are_moderate_in_number(shapes):
    for category in shapes:
        assert 1500 < np.median([len(shape.mesh.faces) for shape in shapes[category]]) < 8000
