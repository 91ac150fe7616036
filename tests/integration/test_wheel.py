"""What a user gets who installs the wheel: it runs from any folder, without the checkout."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from runs import program
from samples import TINY

import stereo_occ

CHECKOUT = Path(stereo_occ.__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with nothing but the installed wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    for command in (
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--find-links", folder,
         "--target", folder / "site", "stereo-occ"],
    ):  # fmt: skip
        subprocess.run(command, cwd=CHECKOUT, check=True, capture_output=True, timeout=300)
    return folder / "site"


def test_the_wheel_holds_the_whole_package_and_its_configuration(site):
    def files(root, folder):
        found = (path for path in (root / folder).rglob("*") if path.is_file() and path.suffix != ".pyc")
        return {path.relative_to(root / folder) for path in found}

    package = files(CHECKOUT, "stereo_occ")
    installed = {path for path in files(site, "stereo_occ") if path.parts[0] != "conf"}
    assert installed == package
    assert files(site, "stereo_occ/conf") == files(CHECKOUT, "conf")
    assert (site / "stereo_occ" / "py.typed").exists()
    assert (site / "hydra_plugins" / "stereo_occ_search.py").exists()


def test_it_composes_shows_and_trains_from_a_foreign_folder(site, tmp_path):
    where = program(
        "-c",
        "import stereo_occ, stereo_occ.paths as p; print(stereo_occ.__file__); print(p.conf_dir())",
        cwd=tmp_path,
        PYTHONPATH=str(site),
    )
    assert where.stdout.splitlines() == [
        str(site / "stereo_occ" / "__init__.py"),
        str(site / "stereo_occ" / "conf"),
    ]
    shown = program("-m", "stereo_occ.train", "--cfg", "job", cwd=tmp_path, PYTHONPATH=str(site))
    assert shown.returncode == 0, shown.stderr
    assert "steps: ${scale.steps}" in shown.stdout
    assert os.listdir(tmp_path) == []  # noqa: PTH208 hidden files too


def test_a_sweep_of_both_models(site, tmp_path):
    """Where ImageNet weights are not to be had, the job that needs them says so and the others run."""
    model = [o for o in TINY if o.startswith(("model.width", "model.encoder"))]
    common = [o for o in TINY if o not in model] + ["steps=2", "validation.interval=2", "logger=none"]
    cache = {"TORCH_HOME": str(tmp_path / "empty")}
    done = program(
        "-m", "stereo_occ.train", "-m", *common, "model=mono,stereo", cwd=tmp_path, PYTHONPATH=str(site),
        http_proxy="http://127.0.0.1:9", https_proxy="http://127.0.0.1:9", **cache,
    )  # fmt: skip
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.startswith("stereo_occ:")]
    assert len(lines) == 1, done.stderr
    (line,) = lines
    assert line.startswith("stereo_occ: model.encoder.weights: IMAGENET1K_V1 is not at")
    assert line.endswith("or train from scratch with model.encoder.weights=null")
    assert "Traceback" not in done.stderr
    (sweep_folder,) = (tmp_path / "outputs" / "sweeps").iterdir()
    assert not (sweep_folder / "0_mono_seed0" / "best.ckpt").exists()
    assert (sweep_folder / "1_stereo_seed0" / "best.ckpt").is_file()  # the rest of the sweep went on
