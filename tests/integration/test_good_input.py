"""Unusual pairs, calibrations and paths that ``reconstruct`` takes: what comes out is what the usual ones give."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from checkpoints import checkpoint_of
from entry_points import EntryPoints
from PIL import Image

import stereo_occ
from stereo_occ.calibration.fields import Fields
from stereo_occ.cli import compose_config
from stereo_occ.reconstruct import reconstruct_pair

EXAMPLES = Path(stereo_occ.__file__).parents[1] / "examples"

GIVEN = {
    "left": "left.png", "right": "right.png", "rig": "rig.yaml", "checkpoint": "tiny.ckpt", "output": "mug.ply",
    "resolution": "16", "threshold": "0.5", "preview": "false",
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """An unusual input.

    Attributes:
        prepare: makes it of the usual files in the folder.
        given: in place of the usual arguments.
        tolerance: how far the vertices may be from the usual ones, metres; None: just any closed mesh.
    """

    name: str
    prepare: Callable[[Path], object] = lambda folder: None
    given: dict[str, str] = field(default_factory=dict)
    tolerance: float | None = 1e-9


def images(
    change: Callable[[Image.Image], Image.Image], suffix: str = ".png", **options
) -> Callable[[Path], None]:
    """Both images changed, under names of their own."""

    def prepare(folder: Path) -> None:
        for side in ("left", "right"):
            with Image.open(folder / f"{side}.png") as image:
                change(image).save(folder / f"{side}_x{suffix}", **options)

    return prepare


def both(suffix: str = ".png") -> dict[str, str]:
    return {"left": f"left_x{suffix}", "right": f"right_x{suffix}"}


def grey16(image: Image.Image) -> Image.Image:
    return Image.fromarray(np.asarray(image.convert("L")).astype(np.uint16) * 257)


def cut_out(image: Image.Image) -> Image.Image:
    """Transparent where it is nearly the background's colour."""
    rgb = np.asarray(image.convert("RGB"))
    away = np.abs(rgb.astype(int) - rgb[0, 0].astype(int)).max(axis=2) > 24
    return Image.fromarray(np.dstack([rgb, 255 * away.astype(np.uint8)]))


def mask(image: Image.Image) -> Image.Image:
    return cut_out(image).getchannel("A")


def calibration(change: Callable[[dict], dict], dump: Callable[[dict], str] = yaml.safe_dump):
    def prepare(folder: Path) -> None:
        values = change(dict(Fields.read(folder / "rig.yaml").values))
        (folder / "rig.yaml").write_text(dump(values), encoding="utf-8")

    return prepare


def millimetres(values: dict) -> dict:
    return values | {"T": [-80, 0, 0]}


def rewritten(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda folder: (folder / "rig.yaml").write_bytes(change((folder / "rig.yaml").read_bytes()))


STRANGE = "Tasse é, 杯 = 'x' (1)"


def renamed(folder: Path) -> None:
    (folder / STRANGE).mkdir()
    for name in ("left.png", "right.png", "rig.yaml", "tiny.ckpt"):
        (folder / name).rename(folder / STRANGE / name)


def strange(*keys: str) -> dict[str, str]:
    quoted = STRANGE.replace("'", r"\'")
    return {key: f"'{quoted}/{GIVEN[key]}'" for key in keys}


CASES = [
    Case("opaque RGBA", images(lambda image: image.convert("RGBA")), both()),
    Case("a palette", images(lambda image: image.convert("RGB").quantize(256)), both(), 0.02),
    Case("BMP", images(lambda image: image.convert("RGB"), ".bmp"), both(".bmp")),
    Case("TIFF", images(lambda image: image.convert("RGB"), ".tif", compression="tiff_lzw"), both(".tif")),
    Case("lossless WebP", images(lambda image: image.convert("RGB"), ".webp", lossless=True), both(".webp")),
    Case("JPEG", images(lambda image: image.convert("RGB"), ".jpg", quality=95), both(".jpg"), None),
    Case("8 bit grey", images(lambda image: image.convert("L")), both(), None),
    Case("16 bit grey", images(grey16), both(), None),
    Case("transparent around the object", images(cut_out), both(), None),
    Case("transparent, of few colours", images(lambda image: cut_out(image).quantize(255)), both(), None),
    Case("masks", images(mask), {"left_mask": "left_x.png", "right_mask": "right_x.png"}, None),
    Case("half the size", images(lambda image: image.resize((480, 270), Image.Resampling.BOX)), both(), None),
    Case("two sizes", images(lambda image: image.resize((480, 270))), {"left": "left_x.png"}, None),
    Case("the unit on the command line", calibration(millimetres), {"unit": "mm"}),
    Case("the unit in the file", calibration(lambda values: millimetres(values) | {"unit": "mm"})),
    Case("the unit as a number", calibration(millimetres), {"unit": "0.001"}),
    Case("JSON", calibration(dict, json.dumps)),
    Case("lines of Windows", rewritten(lambda data: data.replace(b"\n", b"\r\n"))),
    Case("a byte order mark", rewritten(lambda data: b"\xef\xbb\xbf" + data)),
    Case("references in YAML", rewritten(lambda data: data.replace(b"K1:", b"K1: &K").split(b"K2:")[0]
         + b"K2: *K\nD2: [0, 0, 0, 0]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [[-0.08], [0], [0]]\n")),
    Case("a strange folder", renamed, strange("left", "right", "rig", "checkpoint", "output")),
    Case("a suffix in capitals", given={"output": "MUG.PLY"}),
]  # fmt: skip


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    return checkpoint_of(tmp_path_factory.mktemp("run"), name="tiny.ckpt")


def put_pair(folder: Path, checkpoint: Path) -> None:
    for source, name in (("left.png",) * 2, ("right.png",) * 2, ("calibration.yaml", "rig.yaml")):
        shutil.copy(EXAMPLES / source, folder / name)
    shutil.copy(checkpoint, folder / "tiny.ckpt")


@pytest.fixture
def command(tmp_path, monkeypatch, capsys, checkpoint):
    put_pair(tmp_path, checkpoint)
    return EntryPoints(tmp_path, monkeypatch, capsys)


@pytest.fixture(scope="module")
def usual(checkpoint, tmp_path_factory):
    """The usual pair's mesh."""
    folder = tmp_path_factory.mktemp("usual")
    put_pair(folder, checkpoint)
    files = {key: str(folder / GIVEN[key]) for key in ("left", "right", "rig", "checkpoint", "output")}
    given = {"calibration" if key == "rig" else key: value for key, value in (GIVEN | files).items()}
    reconstruct_pair(compose_config("reconstruct", [f"{key}={value}" for key, value in given.items()]))
    return trimesh.load(folder / GIVEN["output"])


def reconstructed(command: EntryPoints, given: dict[str, str]) -> trimesh.Trimesh:
    outcome = command("reconstruct", [f"{key}={value}" for key, value in (GIVEN | given).items()])
    assert (outcome.code, outcome.err) == (0, ""), outcome
    (name,) = (name for name in outcome.touched if name.lower().endswith(".ply"))
    mesh = trimesh.load(command.folder / name, file_type="ply")
    assert mesh.is_watertight
    assert {Path(name).suffix.lower() for name in outcome.touched} <= {".ply", ".json", ""}
    return mesh


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_it_is_taken(case, command, usual):
    case.prepare(command.folder)
    mesh = reconstructed(command, case.given)
    if case.tolerance is None:
        assert mesh.volume > 0
        assert np.abs(mesh.bounds.mean(axis=0) - usual.bounds.mean(axis=0)).max() < 0.05
    elif case.tolerance < 1e-6:
        np.testing.assert_allclose(mesh.vertices, usual.vertices, atol=case.tolerance)
    else:
        np.testing.assert_allclose(mesh.bounds, usual.bounds, atol=case.tolerance)


def test_a_mistake_does_not_outlive_its_call(command):
    """Several commands of one process, as a notebook runs them: each has its own exit code."""
    (command.folder / "broken.png").write_bytes(b"no picture")
    given = GIVEN | {"left": "broken.png"}
    assert command("reconstruct", [f"{key}={value}" for key, value in given.items()]).code == 2
    reconstructed(command, {})
