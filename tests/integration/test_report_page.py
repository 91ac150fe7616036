"""The report of real evaluations in a real browser, without network."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from browser import browser, find_chromium
from runs import program
from samples import single_line

from stereo_occ.kept_views import read_kept_views

SMALL = ["subset=val", "meshes=1", "mesh_resolution=32", "surface_points=300", "examples=0"]

#: What is around the mesh in a viewer.
GROUND = np.array([0xF1, 0xF3, 0xF6])


@pytest.fixture(scope="module")
def page(workshop, run, tmp_path_factory):
    """The report of a network and of the visual hull, by the command."""
    folder = tmp_path_factory.mktemp("report")
    workshop.evaluate(run / "best.ckpt", folder / "network", *SMALL)
    workshop.evaluate(run / "best.ckpt", folder / "hull", *SMALL, "baseline=visual_hull")
    done = program(
        "-m", "stereo_occ.report", "runs=[network,hull]", "output=report.html", "draws=100", cwd=folder
    )
    assert done.returncode == 0, done.stderr
    return folder / "report.html"


def test_the_command_writes_page_markdown_and_figures(page):
    names = {path.name for path in page.parent.iterdir()}
    assert {"report.html", "report.md", "report_figures"} <= names
    assert names <= {"report.html", "report.md", "report_figures", "network", "hull"}
    text = page.with_suffix(".md").read_text()
    assert "| stereo - visual_hull |" in text
    figures = {path.stem for path in (page.parent / "report_figures").iterdir()}
    assert figures >= {"learning_curves", "precision_recall", "reliability", "scatter", "differences"}
    for figure in figures:
        assert f"(report_figures/{figure}.png)" in text
    assert len(read_kept_views(page.parent / "network")) == 3


def test_what_an_evaluation_keeps_for_it(workshop, run, page, tmp_path):
    folder = page.parent / "network"
    curves = json.loads((folder / "curves.json").read_text())["categories"]
    facts = json.loads((folder / "metrics.json").read_text())
    for category, sides in curves.items():  # one object, two views, 500 points each
        assert sum(sides["empty"]) + sum(sides["occupied"]) == 1000
        points, _, share = np.array(facts["reliability"][category]).T
        assert sum(sides["occupied"]) == pytest.approx((points * share).sum())
    whole = json.loads((run / "metrics.json").read_text())["history"]
    assert facts["trained"]["history"] == whole
    alone = shutil.copy(run / "best.ckpt", tmp_path)
    workshop.evaluate(Path(alone), tmp_path / "alone", *SMALL, "keep=false")
    facts = json.loads((tmp_path / "alone" / "metrics.json").read_text())
    assert facts["trained"]["history"] == [entry for entry in whole if entry["step"] <= facts["step"]]
    assert not (tmp_path / "alone" / "views").exists()


def test_what_is_no_evaluation_is_one_line(tmp_path):
    refused = program("-m", "stereo_occ.report", "runs=[.]", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr.startswith("stereo_occ: .: has no readable metrics.json")
    assert single_line(refused.stderr.rstrip())


def test_it_works_in_a_browser_without_network(page, tmp_path):
    """Nothing is asked of the network, nothing complains, meshes are drawn, and those of a row turn together."""
    chromium = find_chromium()
    if chromium is None:
        pytest.skip("there is no Chromium here: install it to test the page")
    with browser(chromium, tmp_path / "profile") as opened:
        opened.open(page)
        opened.evaluate(
            "document.querySelector('.row').scrollIntoView({behavior: 'instant', block: 'start'})"
        )
        mesh = ".row .mesh:last-child model-viewer"  # the truth
        opened.wait(f"document.querySelector('{mesh}').modelIsVisible")
        before = drawn(opened, mesh)
        assert 0.02 < before.mean() < 0.9
        viewers = "[...document.querySelectorAll('.row')[0].querySelectorAll('model-viewer')]"
        assert opened.evaluate(f"{viewers}.length") >= 2
        opened.wait(f"{viewers}.every((viewer) => viewer.modelIsVisible)")
        first = orbits(opened, viewers)
        drag(opened, mesh)
        opened.wait(f"{viewers}.every((v) => Math.abs(v.getCameraOrbit().theta - {first[-1][0]}) > 0.3)")
        opened.wait(f"new Set({viewers}.map((v) => v.getCameraOrbit().theta.toFixed(3))).size === 1")
        after = drawn(opened, mesh)
        assert (before != after).mean() > 0.005  # the live mesh turned; a still picture would not
        assert opened.errors == []
        assert {request.partition(":")[0] for request in opened.requests} <= {"file", "data", "blob"}
        assert len([request for request in opened.requests if request.startswith("file:")]) == 1


def drawn(opened, selector):
    """Pixels ``(H, W)`` of an element that are not ground."""
    return (np.abs(opened.pixels(selector).astype(int) - GROUND) > 12).any(axis=2)


def orbits(opened, viewers):
    return opened.evaluate(f"{viewers}.map((v) => [v.getCameraOrbit().theta, v.getCameraOrbit().phi])")


def drag(opened, selector):
    """Pull the pointer over an element, to the right."""
    box = opened.evaluate(
        f"(() => {{ const b = document.querySelector('{selector}').getBoundingClientRect();"
        "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    for kind, shift in (("mousePressed", 0), ("mouseMoved", 30), ("mouseMoved", 60), ("mouseReleased", 60)):
        button = {"button": "left", "buttons": 0 if kind == "mouseReleased" else 1, "clickCount": 1}
        opened.call("Input.dispatchMouseEvent", type=kind, x=box[0] + shift, y=box[1], **button)
