"""``python -m stereo_occ.compare`` on small result folders."""

import csv
import errno
import json
import os

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from samples import single_line

from stereo_occ import compare
from stereo_occ.provenance import PROTOCOL, SCHEMA

FACTS = {
    "schema": SCHEMA,
    "protocol": PROTOCOL,
    "subset": "test",
    "views": 2,
    "points": 100,
    "meshes": {"views": 0},
    "metrics": {},
}
FACTS |= {"split": {"hash": "a"}, "commit": None, "data": "x"}


def evaluation(folder, iou_of, objects=6, **facts):
    """Two views of mugs and of bowls; bowls have no handle."""
    folder.mkdir(parents=True)
    (folder / "metrics.json").write_text(json.dumps(FACTS | facts))
    with (folder / "per_object.csv").open("w", newline="") as file:
        writer = csv.DictWriter(
            file, ["category", "object_id", "view", "failure", "iou", "handle_recall", "mesh_iou"]
        )
        writer.writeheader()
        for category in ("mug", "bowl"):
            for index in range(objects):
                for view in range(2):
                    iou = iou_of(category, index, view)
                    handle = iou / 2 if category == "mug" else ""
                    row = {"category": category, "object_id": f"{category}_{index}", "view": view}
                    writer.writerow(
                        row | {"failure": "", "iou": iou, "handle_recall": handle, "mesh_iou": ""}
                    )
    return folder


def hard(category, index, view):
    return 0.1 * index + 0.05 * view + (0.2 if category == "bowl" else 0)


def run(tmp_path, capsys, a, b, *more):
    compare.main([str(a), str(b), "--output", str(tmp_path / "out"), "--draws", "300", *more])
    return capsys.readouterr().out, json.loads((tmp_path / "out" / "comparison.json").read_text())


def refusal(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        compare.main([str(argument) for argument in arguments])
    assert stop.value.code == 2
    return capsys.readouterr().err


def test_a_constant_gain(tmp_path, capsys):
    a = evaluation(tmp_path / "a", lambda *view: hard(*view) + 0.1)
    b = evaluation(tmp_path / "b", hard)
    printed, record = run(tmp_path, capsys, a, b)
    macro = record["results"]["iou"]["macro"]
    assert (macro["difference"], macro["low"], macro["high"]) == pytest.approx((0.1, 0.1, 0.1))
    assert macro["clear"]
    assert set(record["results"]) == {"iou", "handle_recall"}  # what neither has is left out
    assert set(record["results"]["handle_recall"]) == {"mug", "macro"}
    assert record["results"]["handle_recall"]["macro"]["difference"] == pytest.approx(0.05)
    assert "[+0.1000, +0.1000] *" in printed
    with Image.open(tmp_path / "out" / "comparison.png") as picture:
        assert picture.width > 1000


def test_several_seeds_by_a_pattern(tmp_path, capsys):
    for seed, gain in enumerate((0.0, 0.1, 0.2)):
        evaluation(tmp_path / f"a_seed{seed}", lambda *view, gain=gain: hard(*view) + gain)
    b = evaluation(tmp_path / "b", hard)
    _, record = run(tmp_path, capsys, tmp_path / "a_seed*", b)
    assert len(record["a"]) == 3
    macro = record["results"]["iou"]["macro"]
    assert macro["difference"] == pytest.approx(0.1)
    assert macro["high"] - macro["low"] > 0.1  # from the seeds alone: objects add nothing


def test_only_the_asked_metrics(tmp_path, capsys):
    a, b = evaluation(tmp_path / "a", hard), evaluation(tmp_path / "b", hard)
    _, record = run(tmp_path, capsys, a, b, "--metrics", "iou")
    assert list(record["results"]) == ["iou"]
    assert record["results"]["iou"]["macro"]["clear"] is False


def test_other_training_objects_are_noted(tmp_path, capsys):
    a = evaluation(tmp_path / "a", hard)
    b = evaluation(tmp_path / "b", hard, split={"hash": "b"})
    printed, record = run(tmp_path, capsys, a, b)
    assert record["notes"] == ["split differs: {'hash': 'a'} | {'hash': 'b'}"]
    assert "note: split differs" in printed


def test_what_differs_in_any_folder_is_noted(tmp_path, capsys):
    a = evaluation(tmp_path / "a", hard)
    evaluation(tmp_path / "b_1", hard)
    evaluation(tmp_path / "b_2", hard, data="y")
    _, record = run(tmp_path, capsys, a, tmp_path / "b_*")
    assert record["notes"] == ["data differs: x | y"]


def test_a_folder_may_be_called_anything(tmp_path, capsys):
    a, b = evaluation(tmp_path / r"a_$\no$", hard), evaluation(tmp_path / "b", hard)
    run(tmp_path, capsys, a, b)


@pytest.mark.parametrize(
    ("facts", "complaint"),
    [
        (
            {"objects": 5},
            "4 object-views are only in the first and 0 only in the second, such as bowl/bowl_5/0",
        ),
        ({"points": 200}, "were measured with points 100 and 200"),
        ({"protocol": 0}, f"were measured with protocol {PROTOCOL} and 0"),
        ({"schema": 1}, "metrics.json: is no evaluation of form 2"),
    ],
)
def test_what_cannot_be_compared_is_one_line(tmp_path, capsys, facts, complaint):
    a, b = evaluation(tmp_path / "a", hard), evaluation(tmp_path / "b", hard, **facts)
    message = refusal(capsys, a, b, "--output", tmp_path / "out")
    assert complaint in message
    assert single_line(message.rstrip("\n").replace(str(tmp_path), ""))
    assert not (tmp_path / "out").exists()


def test_all_folders_of_both_sides_are_checked(tmp_path, capsys):
    a = evaluation(tmp_path / "a", hard)
    evaluation(tmp_path / "b_1", hard)
    other = evaluation(tmp_path / "b_2", hard, points=200)
    message = refusal(capsys, a, tmp_path / "b_*", "--output", tmp_path / "out")
    assert f"{a} and {other}: were measured with points 100 and 200" in message


@pytest.mark.parametrize(
    ("of_second", "difference"),
    [
        ({"trained": {"config": {"seed": 1, "model": {"name": "stereo"}}}}, None),
        ({"trained": {"config": {"seed": 1, "model": {"name": "stereo"}, "trainer": {"nodes": 2}}}}, None),
        ({"trained": {"config": {"seed": 0, "model": {"name": "mono"}}}}, "model.name (stereo and mono)"),
        ({"control": {"name": "left_twice", "degrees": 0.0}}, "control.name (none and left_twice)"),
    ],
)
def test_the_folders_of_one_side_are_seeds_of_one_model(tmp_path, capsys, of_second, difference):
    a = evaluation(tmp_path / "a", hard)
    trained = {"config": {"seed": 0, "model": {"name": "stereo"}}}
    evaluation(tmp_path / "b_1", hard, trained=trained)
    evaluation(tmp_path / "b_2", hard, **({"trained": trained} | of_second))
    if difference is None:
        run(tmp_path, capsys, a, tmp_path / "b_*")
    else:
        message = refusal(capsys, a, tmp_path / "b_*", "--output", tmp_path / "out")
        assert (
            f"b_2 are no seeds of one model, they differ in {difference}; compare them one by one" in message
        )
        assert not (tmp_path / "out").exists()


def test_two_evaluations_of_one_training_are_no_seeds(tmp_path, capsys):
    trained = {"config": {"seed": 3, "model": {"name": "stereo"}}}
    best, last = (evaluation(tmp_path / f"b_{name}", hard, trained=trained) for name in ("best", "last"))
    message = refusal(
        capsys, evaluation(tmp_path / "a", hard), tmp_path / "b_*", "--output", tmp_path / "out"
    )
    assert f"{best} and {last} are both of the training with seed 3; give one of them" in message
    assert not (tmp_path / "out").exists()


def test_names_that_are_no_utf8_are_written_as_escapes(tmp_path, capsys):
    a = evaluation(tmp_path / os.fsdecode(b"a\xff"), hard)
    printed, record = run(tmp_path, capsys, a, a)
    assert r"a\udcff (1 seeds)" in printed
    assert record["a"] == [str(a)]
    assert (tmp_path / "out" / "comparison.png").is_file()


def test_a_full_terminal_is_one_line(tmp_path, capsys, monkeypatch):
    def write(text):
        raise OSError(errno.ENOSPC, "No space left on device")

    a = evaluation(tmp_path / "a", hard)
    monkeypatch.setattr("sys.stdout.write", write)
    assert refusal(capsys, a, a, "--output", tmp_path / "out", "--draws", "300").endswith(
        "No space left on device; free some disk space\n"
    )


def cut(path, size):
    path.write_bytes(path.read_bytes()[:size])


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (lambda folder: cut(folder / "per_object.csv", -5), "per_object.csv: is cut off after 23 rows"),
        (lambda folder: cut(folder / "per_object.csv", 60), "per_object.csv: is cut off after 0 rows"),
        (
            lambda folder: (folder / "per_object.csv").write_bytes(b"category,\xff\n"),
            "has no readable per_object.csv",
        ),
        (
            lambda folder: (folder / "per_object.csv").write_text("category,object_id,view\nmug,mug_0,0\n"),
            "per_object.csv: has no column iou",
        ),
        (lambda folder: (folder / "per_object.csv").unlink(), "has no readable per_object.csv"),
        (lambda folder: cut(folder / "metrics.json", 30), "has no readable metrics.json"),
        (lambda folder: (folder / "metrics.json").write_text("[1]"), "is no evaluation of form 2"),
        (lambda folder: damage_facts(folder, points=None), "metrics.json: is damaged, points is None"),
        (lambda folder: damage_facts(folder, trained=3), "metrics.json: is damaged, trained is 3"),
        (lambda folder: damage_facts(folder, trained={"config": []}), "is damaged, trained.config is []"),
        (lambda folder: damage_facts(folder, points=True), "is damaged, points is True"),
        (
            lambda folder: damage_facts(folder, trained={"config": {"model": {"name": 3}}}),
            "is damaged, trained.config.model.name is 3",
        ),
        (
            lambda folder: damage_facts(folder, predictor={"baseline": 3}),
            "is damaged, predictor.baseline is 3",
        ),
        (lambda folder: damage_facts(folder, control={"name": []}), "is damaged, control.name is []"),
        (lambda folder: damage_facts(folder, metrics=[0.5]), "metrics.json: is damaged, metrics is [0.5]"),
    ],
)
def test_a_damaged_evaluation_is_one_line(tmp_path, capsys, damage, complaint):
    check_damage(tmp_path, capsys, damage, complaint)


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        (b"mug,mug_7", "per_object.csv: is cut off after 24 rows"),
        (b"mug,mug_7\n", "per_object.csv: is damaged in row 25, which has not as many cells as the head"),
        (
            b"mug,mug_7,0,,0.1,,,0.5\n",
            "per_object.csv: is damaged in row 25, which has not as many cells as the head",
        ),
        (b"mug,mug_5,1,,0.1,,\n", "per_object.csv: is damaged in row 25, 'mug/mug_5/1' is there twice"),
        (
            b"mug,mug_7,0,,half,,\n",
            "per_object.csv: is damaged in row 25, could not convert string to float: 'half'",
        ),
        (b"mug,mug_7,0,,nan,,\n", "per_object.csv: is damaged in row 25, iou is 'nan'"),
    ],
)
def test_a_damaged_row_is_one_line(tmp_path, capsys, row, complaint):
    def append(folder):
        table = folder / "per_object.csv"
        table.write_bytes(table.read_bytes() + row)

    check_damage(tmp_path, capsys, append, complaint)


def check_damage(tmp_path, capsys, damage, complaint):
    a, b = evaluation(tmp_path / "a", hard), evaluation(tmp_path / "b", hard)
    damage(b)
    message = refusal(capsys, a, b, "--output", tmp_path / "out")
    assert complaint in message
    assert single_line(message.rstrip("\n").replace(str(tmp_path), ""))
    assert not (tmp_path / "out").exists()


def damage_facts(folder, **facts):
    (folder / "metrics.json").write_text(json.dumps(FACTS | facts))


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--draws", 0), "--draws 0: must be from 1 to 100000"),
        (("--draws", 10**11), "--draws 100000000000: must be from 1 to 100000"),
        (("--seed", -1), "--seed -1: must not be negative"),
    ],
)
def test_impossible_draws(tmp_path, capsys, arguments, complaint):
    a = evaluation(tmp_path / "a", hard)
    assert complaint in refusal(capsys, a, a, "--output", tmp_path / "out", *arguments)


def test_nothing_is_written_where_not_all_can_be(tmp_path, capsys):
    a = evaluation(tmp_path / "a", hard)
    (tmp_path / "out" / "comparison.png").mkdir(parents=True)
    assert "comparison.png in it is a folder" in refusal(capsys, a, a, "--output", tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["comparison.png"]
    (tmp_path / "file").touch()
    message = refusal(capsys, a, a, "--output", tmp_path / "file")
    assert (
        "Not a directory; choose another folder" in message or "File exists; choose another folder" in message
    )


def test_a_plot_that_cannot_be_written_leaves_nothing(tmp_path, capsys, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device", "comparison.png")

    a = evaluation(tmp_path / "a", hard)
    monkeypatch.setattr(Figure, "savefig", full)
    message = refusal(capsys, a, a, "--output", tmp_path / "out")
    assert "comparison.png: No space left on device; free some disk space" in message
    assert list((tmp_path / "out").iterdir()) == []


def test_an_output_that_refers_to_itself(tmp_path, capsys):
    a = evaluation(tmp_path / "a", hard)
    (tmp_path / "loop").symlink_to("loop")
    message = refusal(capsys, a, a, "--output", tmp_path / "loop" / "out")
    assert single_line(message.rstrip("\n").replace(str(tmp_path), ""))
    assert "symbolic links; choose another folder" in message


def test_folders_that_are_not_there(tmp_path, capsys):
    a = evaluation(tmp_path / "a", hard)
    assert "no such folder; give the folder of an evaluation" in refusal(capsys, a, tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    assert "has no readable metrics.json" in refusal(capsys, a, tmp_path / "empty")
    assert "--metrics iuo: not in both results" in refusal(capsys, a, a, "--metrics", "iuo")
    assert "quote a pattern" in refusal(capsys, a, a, a)


def test_ten_thousand_draws_of_many_objects_are_one_product(tmp_path, capsys):
    """The default draws; the interval of noise around no difference holds 0."""
    rng = np.random.default_rng(0)
    a = evaluation(tmp_path / "a", lambda *view: hard(*view) + rng.normal(0, 0.1), objects=40)
    b = evaluation(tmp_path / "b", hard, objects=40)
    _, record = run(tmp_path, capsys, a, b, "--draws", "10000")
    macro = record["results"]["iou"]["macro"]
    assert record["draws"] == 10_000
    assert macro["low"] < macro["difference"] < macro["high"]
    assert macro["high"] - macro["low"] == pytest.approx(3.92 * 0.1 / np.sqrt(160), rel=0.25)
