"""What the doctor says, well and ill."""

import json
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from stereo_occ import doctor
from stereo_occ.cli import compose_config

FOUND = {
    "opengl": {"EGL": "Maker", "OpenGL": "software, 4.5"},
    "render": {"pair": 0.006, "object": 0.4},
    "train": {"threads": 2, "gpu": "none", "ms_per_step": {"trainer.precision=32-true": 200.0}},
}


def report(capsys, monkeypatch, **probes):
    """Lines and exit code of the report."""
    monkeypatch.setattr(doctor, "_probe", (FOUND | probes).__getitem__)
    monkeypatch.setattr(doctor, "available_cores", lambda: 2)
    with pytest.raises(SystemExit) as stop:
        doctor.main()
    return capsys.readouterr().out.splitlines(), stop.value.code


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a file of Linux that is always full")
def test_a_report_that_cannot_be_written_is_one_line():
    program = "from stereo_occ import doctor; doctor._probe = lambda what: {'error': 'broken'}; doctor.main()"
    with Path("/dev/full").open("w") as full:
        run = subprocess.run(
            [sys.executable, "-c", program],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            check=False,
        )
    assert run.returncode == 1
    expected = "stereo_occ: <stdout>: No space left on device; let the report go where it can be written"
    assert run.stderr.splitlines() == [expected]


def test_a_machine_that_is_well(capsys, monkeypatch):
    monkeypatch.setattr(
        doctor, "requires", lambda _: ["numpy<3,>=2", "tqdm>=4.66", 'timm>=1.0; extra == "timm"']
    )
    lines, code = report(capsys, monkeypatch)
    assert code == 0
    assert lines[-1] == "All that is needed is here."
    assert "- EGL: Maker" in lines
    assert (
        "- training, trainer.precision=32-true: 200 ms per step; "
        "40,000 steps of model=stereo at scale=laptop ~ 2.2 h" in lines
    )
    expected = "167 pairs of 64 px a second on one core; scale=laptop ~ 5 min, scale=paper_640k ~ 34 min"
    assert f"- rendering: {expected}" in lines
    assert [line.split()[1] for line in lines if line.startswith("| ")] == ["package", "numpy", "tqdm"]


def test_the_estimates_are_of_these_scales():
    for name, views in doctor.VIEWS.items():
        cfg = compose_config("train", [f"scale={name}"])
        assert (cfg.data.views, sum(cfg.data.counts.values()), cfg.steps) == (
            views,
            doctor.OBJECTS,
            doctor.STEPS,
        )


def test_missing_opengl_is_to_be_installed(capsys, monkeypatch):
    lines, code = report(
        capsys, monkeypatch, opengl={"error": "rendering needs OpenGL: apt-get install libegl1"}
    )
    assert code == 1
    assert lines[-2:] == ["To do:", "- rendering needs OpenGL: apt-get install libegl1"]
    assert "- rendering: does not work" in lines
    assert any("ms per step" in line for line in lines)


def test_packages_that_are_missing_or_too_old(capsys, monkeypatch):
    installed = {"numpy": "1.26.4", "torch": "2.8.0+cpu"}

    def version(name):
        if name not in installed:
            raise PackageNotFoundError
        return installed[name]

    monkeypatch.setattr(doctor, "version", version)
    monkeypatch.setattr(doctor, "requires", lambda _: ["numpy<3,>=2", "torch<3,>=2.8", "h5py>=3.12"])
    lines, code = report(capsys, monkeypatch)
    assert code == 1
    assert lines[-1] == "- pip install 'numpy<3,>=2' 'h5py>=3.12'"
    assert "- the rest: not tried; first see below" in lines
    assert "| numpy | **1.26.4** | <3,>=2 |" in lines
    assert "| h5py | **missing** | >=3.12 |" in lines
    assert "| torch | 2.8.0+cpu | <3,>=2.8 |" in lines


@pytest.mark.parametrize(
    ("installed", "bound", "fits"),
    [
        ("2.10.1", ">=2.8", True),
        ("2.8.0", ">=2.8", True),
        ("2.8", ">=2.8.0", True),
        ("2.7.9", ">=2.8", False),
        ("3.0.0", "<3", False),
        ("2.99", "<3", True),
        ("2.17.7.post6", ">=2.17.7.post6", True),
        ("2.17.7", ">=2.17.7.post6", False),
        ("1.0+cu130", "<1.1", True),
        ("1.0", "", True),
    ],
)
def test_versions(installed, bound, fits):
    assert doctor._fits(installed, bound) == fits


def test_an_old_python(capsys, monkeypatch):
    monkeypatch.setattr(doctor, "PYTHON", (99, 1))
    lines, code = report(capsys, monkeypatch)
    assert code == 1
    assert any(line.endswith("is too old: install 99.1 or later") for line in lines)


def test_a_probe_that_fails_says_so_in_one_line(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/nonexistent/python")
    assert "nonexistent" in doctor._probe("opengl")["error"]


def test_the_real_opengl_probe(egl):
    command = [sys.executable, "-m", "stereo_occ.probe", "opengl"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert set(json.loads(done.stdout)) == {"EGL", "OpenGL"}
