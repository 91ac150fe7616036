"""What results say of where they came from, and what a results file refuses."""

import json
import subprocess
from functools import partial

import pytest

from stereo_occ.data.objects import ObjectSource
from stereo_occ.metrics_file import without_nan
from stereo_occ.provenance import commit, environment, split_hash
from stereo_occ.writing import write_json


def sources(*names):
    return [ObjectSource("mug", name, partial(print)) for name in names]


def test_a_split_is_known_by_its_objects_whatever_their_order():
    first = split_hash(sources("a", "b"), sources("c"))
    assert split_hash(sources("b", "a"), sources("c")) == first
    others = [
        split_hash(sources("a"), sources("b", "c")),
        split_hash(sources("a", "b"), sources("d")),
        split_hash(sources("c"), sources("a", "b")),
        split_hash([ObjectSource("bowl", "a", partial(print)), *sources("b")], sources("c")),
    ]
    assert len({first, *others}) == 5


def test_the_commit_is_that_of_the_checkout_that_holds_the_package(tmp_path):
    git = ["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e"]
    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    page = tmp_path / "README.md"
    page.write_text("")
    assert commit(package) == {"commit": None, "dirty": None}
    subprocess.run([*git, "init", "-q"], check=True)
    assert commit(package) == {"commit": None, "dirty": None}  # a repository that does not hold it
    subprocess.run([*git, "add", "."], check=True)
    subprocess.run([*git, "commit", "-qm", "m"], check=True)
    head = subprocess.run(
        [*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True
    ).stdout.strip()
    assert commit(package) == {"commit": head, "dirty": False}
    page.write_text("a result")
    assert commit(package) == {"commit": head, "dirty": False}
    (package / "__init__.py").write_text("x = 1\n")
    assert commit(package) == {"commit": head, "dirty": True}


def test_the_environment_is_plain():
    facts = json.loads(json.dumps(environment()))
    assert set(facts["packages"]) >= {"numpy", "scipy", "trimesh", "manifold3d"}


def test_numbers_that_json_does_not_know_are_refused_or_named(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "metrics.json", {"iou": float("nan")})
    assert not list(tmp_path.iterdir())
    values = {"val/iou": 0.5, "val/loss": float("nan"), "val/x": float("inf")}
    assert without_nan(values) == {
        "val/iou": 0.5, "val/loss": None, "val/x": None, "not_finite": ["val/loss", "val/x"],
    }  # fmt: skip
    assert without_nan({"val/iou": 0.5}) == {"val/iou": 0.5}
