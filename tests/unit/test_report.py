"""``python -m stereo_occ.report`` on small folders: what is seeds of what, what is chosen, what the page says."""

import base64
import hashlib
import io
import json
import re
import shutil

import numpy as np
import pytest
import trimesh
from PIL import Image
from reports import CATEGORIES, FACTS, OBJECTS, evaluation, hard, trained, write_views
from samples import single_line

from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.evaluation_rows import Evaluations
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.kept_views import ViewKeeper, read_kept_views
from stereo_occ.mesh_output import few_faces
from stereo_occ.metrics.curves import LEVELS
from stereo_occ.report import figures
from stereo_occ.report.__main__ import check_report, report
from stereo_occ.report.gallery import GalleryRow, Panel, make_row
from stereo_occ.report.models import Model, labels_of, model_settings, read_models
from stereo_occ.report.page import MODEL_VIEWER, model_viewer
from stereo_occ.report.selection import Choice, best_median_worst, choose_models, failures
from stereo_occ.report.tables import make_tables


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    return write_views(tmp_path_factory.mktemp("kept"))


def run(tmp_path, *folders, **overrides):
    """The page and its Markdown version."""
    settings = [f"{key}='{value}'" for key, value in overrides.items()]
    runs = ",".join(f"'{folder}'" for folder in folders)
    cfg = compose_config(
        "report", [f"runs=[{runs}]", f"output={tmp_path}/out/page.html", "draws=200", *settings]
    )
    page = report(cfg)
    return page.read_text(), page.with_suffix(".md").read_text()


def better(category, index, view):
    return hard(category, index, view) + 0.1


def test_seeds_of_one_model_are_found_whatever_their_folders_are_called(tmp_path):
    folders = [
        evaluation(tmp_path / "x", seed=0),
        evaluation(tmp_path / "y", model="mono"),
        evaluation(
            tmp_path / "z", seed=1, trained=trained("stereo", 1, workers=3, paths={"data": "elsewhere"})
        ),
        evaluation(tmp_path / "shuffled", seed=2, control={"name": "right_shuffled", "degrees": 0.0}),
    ]
    models = read_models(folders)
    assert [model.label for model in models] == ["stereo", "mono", "stereo, control=right_shuffled"]
    assert [model.folders for model in models] == [[folders[0], folders[2]], [folders[1]], [folders[3]]]
    assert [model.evaluations.seeds for model in models] == [[0, 1], [0], [2]]
    assert [model.uses_pair for model in models] == [True, False, False]


def test_labels_say_what_differs():
    settings = [
        {"model.name": "stereo", "steps": 10, "optimizer.lr": 0.1},
        {"model.name": "stereo", "steps": 20, "optimizer.lr": 0.1},
        {"model.name": "mono", "steps": 20, "optimizer.lr": 0.1},
        {"baseline.name": "sgm"},
    ]
    assert labels_of(settings) == ["stereo, steps=10", "stereo, steps=20", "mono", "sgm"]
    many = [{"model.name": "stereo", **{f"group.key{i}": value for i in range(5)}} for value in (1, 2)]
    assert labels_of(many)[1] == "stereo, key0=2, key1=2, key2=2, ..."


def test_a_network_trained_under_a_control_is_another_model():
    config = {"model": {"name": "stereo"}, "control": {"name": "left_twice", "degrees": 0.0}}
    facts = FACTS | {"trained": {"config": config, "history": []}}
    same = model_settings(facts | {"control": {"name": "left_twice", "degrees": 0.0}})
    other = model_settings(facts | {"control": {"name": "none", "degrees": 0.0}})
    assert "trained_under_control.name" not in same
    assert other["trained_under_control.name"] == "left_twice"
    assert labels_of([other, model_settings(FACTS | {"trained": trained("stereo", 0)})])[0] == (
        "stereo, trained_under_control=left_twice"
    )


@pytest.mark.parametrize(
    ("trained_under", "seen", "pair"),
    [
        ("none", "none", True),
        ("none", "calibration_off", True),
        ("calibration_off", "calibration_off", True),
        ("left_twice", "none", False),
        ("none", "right_shuffled", False),
    ],
)
def test_a_wrong_calibration_leaves_a_model_its_pair(tmp_path, trained_under, seen, pair):
    control = {"name": seen, "degrees": 1.0}
    of_training = trained("stereo", 0, control={"name": trained_under, "degrees": 1.0})
    folder = evaluation(tmp_path / "run", trained=of_training, control=control)
    assert read_models([folder])[0].uses_pair == pair


def test_best_median_and_worst():
    keys = [("mug", f"m{i}", 0) for i in range(4)] + [("bowl", "b0", 0), ("bowl", "b1", 0)]
    chosen = best_median_worst(keys, np.array([0.4, 0.1, 0.3, 0.2, 0.9, 0.8]))
    assert list(chosen) == ["mug", "bowl"]
    assert [(choice.key[1], choice.reason) for choice in chosen["mug"]] == [
        ("m0", "best"), ("m3", "median"), ("m1", "worst"),
    ]  # fmt: skip
    assert [(choice.key[1], choice.reason) for choice in chosen["bowl"]] == [("b0", "best"), ("b1", "median")]


def test_failures_pass_over_what_is_shown_and_what_wins():
    keys = [("mug", f"m{i}", 0) for i in range(7)]
    iou = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    against = np.array([0.0, 0.0, 0.0, 0.0, 0.8, 0.9, 0.6])
    (choices,) = failures(keys, iou, against, [keys[0], keys[6]]).values()
    assert [choice.key[1] for choice in choices] == ["m1", "m2", "m4"]
    assert choices[0].reason == "second lowest, 0.20"
    assert choices[2].reason == "loses most, -0.30"
    assert [c.key[1] for c in failures(keys, iou, None, keys[:1])["mug"]] == ["m1", "m2"]


def test_table_1_and_its_intervals(tmp_path):
    folders = [
        evaluation(tmp_path / "a0", better),
        evaluation(tmp_path / "a1", better, seed=1),
        evaluation(tmp_path / "b", model="mono"),
        evaluation(tmp_path / "hull", predictor={"baseline": {"name": "visual_hull"}}, trained=None),
    ]
    models = read_models(folders)
    focus, against = choose_models(models, None, None)
    assert (focus.label, against.label) == ("stereo", "mono")
    tables = make_tables(models, focus, against, draws=300)
    assert tables.columns == ["iou", "iou/mug", "iou/bowl", "iou_bbox", "iou_unrotated"]
    rows = {row.label: row.cells for row in tables.table_1}
    assert rows["stereo"]["iou/mug"].value == pytest.approx(0.1 + 0.225)
    assert rows["mono"]["iou"].text == "0.325"
    spread = rows["mono"]["iou/mug"]
    assert 0.025 < spread.low < spread.value < spread.high < 0.425
    gain = rows["stereo - mono"]["iou"]
    assert (gain.text, gain.interval, gain.clear) == ("+0.100", "[+0.100, +0.100]", True)
    assert not rows["stereo"]["iou"].clear
    assert "iou_unrotated" not in rows["mono"]  # was not measured
    assert choose_models(models, "visual_hull", "stereo")[0].label == "visual_hull"


def test_the_page_and_its_markdown_version(tmp_path, views):
    a = evaluation(tmp_path / "a", better, views=views)
    b = evaluation(tmp_path / "b", model="mono", views=views)
    page, text = run(tmp_path, a, b, title="<script>x</script>")
    assert "<script>x</script>" not in page
    assert page.count("model-viewer src=") == 3 * (3 + 2) * len(CATEGORIES)
    assert page.count(model_viewer()[:2000]) == 1
    own = page.replace(model_viewer(), "")
    assert not re.findall(r'<[^>]* (?:src|href)="(?!data:|#)', own)  # it needs no other file
    for name in ("learning_curves", "precision_recall", "reliability", "scatter", "differences"):
        assert f'<section id="{name}">' in page
        with Image.open(tmp_path / "out" / "page_figures" / f"{name}.png") as picture:
            assert picture.width > 400
    assert "| stereo - mono |  | +0.100 [+0.100, +0.100] * |" in text
    assert "0.1896" in page
    assert "0.1896" in text
    ids = re.findall(r'\bid="([^"]+)"', own)
    assert len(ids) == len(set(ids))


def test_what_older_evaluations_lack_is_said(tmp_path, views):
    a = evaluation(tmp_path / "a", better, trained=None)
    (a / "curves.json").unlink()
    b = evaluation(tmp_path / "b", model="mono", views=views)
    page, text = run(tmp_path, a, b)
    old = "network of 1.5 M parameters"
    for missing in ("No learning curve of", "No precision-recall curve of", "No meshes of"):
        assert f"{missing} {old}" in page
        assert f"> {missing} {old}" in text
    assert '<section id="figure_5">' not in page
    assert '<section id="precision_recall">' in page  # of the other one


def test_one_model_alone_is_reported(tmp_path):
    page, _ = run(tmp_path, evaluation(tmp_path / "a"))
    assert "There is one model only" in page
    assert '<section id="scatter">' not in page


@pytest.mark.parametrize(
    ("facts", "complaint"),
    [
        ({"split": {"hash": "b"}}, "have other training or test objects (split a and b)"),
        ({"data": "x/procedural_64px_def"}, "saw other renders, so other poses"),
        ({"points": 7}, "were measured with points 100 and 7; evaluate both in the same way"),
        ({"schema": 1}, "is no evaluation of form"),
    ],
)
def test_what_is_not_of_one_test_set_is_one_line(tmp_path, facts, complaint):
    a, b = evaluation(tmp_path / "a"), evaluation(tmp_path / "b", model="mono", **facts)
    with pytest.raises(UserError) as refusal:
        run(tmp_path, a, b)
    assert complaint in str(refusal.value)
    assert single_line(str(refusal.value).replace(str(tmp_path), ""))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("facts", "complaint"),
    [
        ({"metrics": {}}, "metrics.test/iou is None"),
        ({"metrics": {"test/iou": float("nan")}}, "metrics.test/iou is nan"),
        ({"threshold": "0.5"}, "threshold is '0.5'"),
        ({"meshes": {}}, "meshes.views is None"),
        ({"trained": 3}, "trained is 3"),
        ({"trained": None, "parameters": "many"}, "parameters is 'many'"),
        ({"trained": trained("stereo", 0) | {"history": 3}}, "trained.history is 3"),
        ({"trained": trained("stereo", 0) | {"history": [3]}}, "trained.history has 3"),
        ({"trained": trained("stereo", 0) | {"history": [{"val/iou": 1}]}}, "trained.history: step is None"),
        ({"trained": {"config": {}}}, "trained.config.model is None"),
        ({"reliability": None}, "reliability is None"),
        ({"reliability": {"mug": []}}, "reliability of"),
        ({"reliability": {"mug": [[1, 0.5]], "bowl": [[1, 0.5]]}}, "is [[1, 0.5]]"),
        ({"reliability": {"mug": [[1, -9, 0.5]], "bowl": [[1, -9, 0.5]]}}, "is [[1, -9, 0.5]]"),
    ],
)
def test_damaged_metrics_are_one_line(tmp_path, facts, complaint):
    folder = evaluation(tmp_path / "a", **facts)
    with pytest.raises(UserError) as refusal:
        run(tmp_path, folder)
    message = str(refusal.value)
    assert message.startswith(f"{folder}/metrics.json: is damaged, ")
    assert complaint in message
    assert single_line(message.replace(str(tmp_path), ""))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("of_mugs", "of_bowls"),
    [
        (3, 3),
        ({"empty": [1] * 130, "occupied": [1] * 130}, None),
        ({"empty": [1], "occupied": [1]}, {"empty": [1], "occupied": [1]}),
        ({"empty": [10**30] * 130, "occupied": [1] * 130}, {"empty": [1] * 130, "occupied": [1] * 130}),
        ({"empty": [-1] * 130, "occupied": [1] * 130}, {"empty": [1] * 130, "occupied": [1] * 130}),
    ],
)
def test_damaged_curves_are_one_line(tmp_path, of_mugs, of_bowls):
    folder = evaluation(tmp_path / "a")
    curves = {"levels": LEVELS.tolist(), "categories": {"mug": of_mugs, "bowl": of_bowls}}
    (folder / "curves.json").write_text(json.dumps(curves))
    with pytest.raises(UserError, match=r"a/curves\.json: is damaged or of another version"):
        run(tmp_path, folder)


def test_a_label_is_no_formula(tmp_path, views):
    """In the page, and in the sheets of pictures beside its Markdown."""
    folders = [
        evaluation(tmp_path / name, trained=trained("stereo", 0, steps=rf"$\no_{name}$"), views=views)
        for name in "ab"
    ]
    page, _ = run(tmp_path, *folders)
    assert r"stereo, steps=$\no_a$" in page


def test_dots_of_the_scatter_are_means_of_each_objects_views():
    """Of 5,000 objects: to look at all views for each of them would take minutes."""
    keys = [("mug", f"m{index:04}", view) for index in range(5000) for view in range(16)]
    values = np.linspace(0.1, 0.9, len(keys))
    models = [
        Model(name, {}, Evaluations(name, [], keys, {"iou": values_V[None]}, []), True)
        for name, values_V in (("a", values), ("b", values[::-1]))
    ]
    (axis,) = figures.scatter(models[1], models[0]).axes
    dots_O2 = axis.collections[0].get_offsets()
    np.testing.assert_allclose(dots_O2[:, 0], values.reshape(5000, 16).mean(axis=1))
    np.testing.assert_allclose(dots_O2[:, 1], values[::-1].reshape(5000, 16).mean(axis=1))


def test_folders_that_hold_no_evaluation(tmp_path, views):
    a = evaluation(tmp_path / "a", views=views)
    with pytest.raises(UserError, match="no such folder; give the folder of an evaluation"):
        run(tmp_path, tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match=r"has no readable metrics\.json"):
        run(tmp_path, a, tmp_path / "empty")
    with pytest.raises(UserError, match="focus=sterio: no model has this label; did you mean stereo"):
        run(tmp_path, a, focus="sterio")
    (a / "curves.json").write_text("{")
    with pytest.raises(UserError, match=r"curves\.json: is damaged"):
        run(tmp_path, a)
    shutil.rmtree(a / "views" / "mug")
    (a / "curves.json").unlink()
    with pytest.raises(UserError, match="cannot be read; evaluate the checkpoint again"):
        run(tmp_path, a)


@pytest.mark.parametrize(
    ("override", "complaint"),
    [
        ("output=x.pdf", "must end in .html"),
        ("draws=0", "must be from 1 to 100000"),
        ("draws=100000000", "must be from 1 to 100000"),
        ("runs=[]", "names no folder"),
    ],
)
def test_problems_of_the_command_line(override, complaint):
    (problem,) = check_report(compose_config("report", ["runs=[x]", override]))
    assert complaint in problem


def test_kept_views_read_back(views):
    kept = read_kept_views(views.parent)
    assert len(kept) == OBJECTS * len(CATEGORIES)
    view = kept["mug", "mug_3", 0]
    true = trimesh.load_mesh(view.mesh_file("true"))
    assert true.is_volume
    expected = toed_in_rig(1.0, np.pi / 16, np.pi / 3, 16).left
    assert view.rig.left.camera_from_rig == pytest.approx(expected.camera_from_rig, abs=1e-6)
    assert np.allclose(view.rig.left.K, expected.K, atol=1e-4)
    with Image.open(view.pair_file) as pair:
        assert pair.size == (32, 16)


def test_an_evaluation_that_keeps_nothing_leaves_no_former_views(tmp_path):
    write_views(tmp_path)
    assert read_kept_views(tmp_path)
    ViewKeeper(tmp_path).write_index()
    assert read_kept_views(tmp_path) == {}


def test_a_row_looks_from_the_left_camera(views, tmp_path):
    """Azimuth -pi/16 at 1 m and level, for an object about the fixation point, with all of it in view."""
    (model,) = read_models([evaluation(tmp_path / "a", views=views)])
    kept = read_kept_views(tmp_path / "a")["bowl", "bowl_2", 0]
    row = make_row(Choice(kept.key, "best"), [kept], [(model, "#0072b2")])
    assert row.orbit == pytest.approx((-180 / 16, 90, 1), abs=1.5)
    assert [panel.caption for panel in row.panels] == ["stereo: IoU 0.40", "truth"]
    assert 2 * np.degrees(np.arcsin(0.25)) < row.fov < 75
    centred = GalleryRow(row.choice, row.pictures, row.panels, np.zeros(3), (-11.25, 90, 1), 60)
    assert centred._camera_from_rig == pytest.approx(kept.rig.left.camera_from_rig, abs=1e-6)


def test_panels_are_glb_files_of_their_colour():
    ball = trimesh.creation.icosphere(2, 0.3)
    panel = Panel("ball", "#bc8000", ball)
    read = trimesh.load_mesh(io.BytesIO(base64.b64decode(panel.glb)), file_type="glb")
    assert read.volume == pytest.approx(ball.volume, rel=1e-4)
    color = read.visual.material.baseColorFactor
    # glTF's factors are linear: 0.737 and 0.502 of sRGB are 0.503 and 0.216.
    assert color[:3].tolist() == pytest.approx([128, 55, 0], abs=1)
    assert Panel("nothing", "#000000", trimesh.Trimesh()).empty


def test_few_faces_keep_the_shape():
    ball = trimesh.creation.icosphere(6, 0.4)
    simple = few_faces(ball, 2000)
    assert len(simple.faces) <= 2000 < len(ball.faces)
    assert simple.is_volume
    assert simple.volume == pytest.approx(ball.volume, rel=0.02)
    assert few_faces(simple, 2000) is simple
    torn = trimesh.Trimesh(ball.vertices, ball.faces[:-7], process=False)  # bounds no solid
    coarse = few_faces(torn, 2000)
    assert len(coarse.faces) <= 2000
    assert coarse.bounds == pytest.approx(ball.bounds, abs=0.04)


def test_a_plot_is_the_same_whenever_it_is_drawn(tmp_path):
    models = [(model, "#0072b2") for model in read_models([evaluation(tmp_path / "a")])]
    first, again, other = (figures.svg(figures.reliability(models), name) for name in ("a", "a", "b"))
    assert first == again
    ids = [set(re.findall(r'\bid="([^"]+)"', text)) for text in (first, other)]
    assert not ids[0] & ids[1]
    assert re.match(r"<svg[^>]*viewBox", first)


def test_reliability_of_seeds_is_that_of_their_points_together():
    points, mean, occupied = figures._pooled([[[30, 0.1, 0.5], [10, 0.99, 1.0]], [[10, 0.12, 0.1]]])
    assert points.tolist() == [40, 10]
    assert mean == pytest.approx([(3 + 1.2) / 40, 0.99])
    assert occupied == pytest.approx([(15 + 1) / 40, 1.0])


def test_the_viewer_is_the_one_that_its_readme_names():
    text = model_viewer() + "//# sourceMappingURL=model-viewer.min.js.map\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    assert digest in (MODEL_VIEWER.parent / "README.md").read_text()
    assert "</script" not in text  # would end the page's script
