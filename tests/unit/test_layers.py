"""What each part of the package may know of the others."""

import re

import pytest

from stereo_occ.paths import PACKAGE

#: Of other parts; ``errors`` is everybody's.
KNOWN: dict[str, set[str]] = {
    "geometry": set(),
    "models": {"geometry"},
    "shapes": {"occupancy", "printable", "writing"},
    "occupancy": {"geometry", "shapes"},
}


def imports(part):
    """Lines ``from stereo_occ.PART...`` and ``import LIBRARY``: the first names."""
    text = "\n".join(path.read_text() for path in (PACKAGE / part).rglob("*.py"))
    return set(re.findall(r"^\s*(?:from|import) ((?:stereo_occ\.)?\w+)", text, re.MULTILINE))


@pytest.mark.parametrize("part", KNOWN)
def test_a_part_knows_only_what_is_below_it(part):
    own = {name.partition(".")[2] for name in imports(part) if name.startswith("stereo_occ.")}
    assert own - {part, "errors"} == KNOWN[part]


@pytest.mark.parametrize("part", ["data", "geometry", "models", "occupancy", "shapes"])
def test_lightning_is_in_the_data_module_alone(part):
    having = [
        p.name
        for p in (PACKAGE / part).rglob("*.py")
        if re.search(r"^\s*(from|import) lightning", p.read_text(), re.M)
    ]
    assert having == (["datamodule.py"] if part == "data" else [])


def test_data_knows_of_models_only_what_they_are_shown():
    text = "\n".join(path.read_text() for path in (PACKAGE / "data").rglob("*.py"))
    assert set(re.findall(r"from stereo_occ\.models.*", text)) == {
        "from stereo_occ.models.base import StereoViews"
    }
