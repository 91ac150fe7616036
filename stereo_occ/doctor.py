"""``python -m stereo_occ.doctor``: what this machine can do, and what to install, to paste into an issue.

Needs nothing but Python, so that it works where something is missing or broken; what needs more is tried in processes
of its own (:mod:`stereo_occ.probe`). Ends with exit code 1 if something needed is missing.
"""

from __future__ import annotations  # for the Pythons that it finds too old

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from stereo_occ.cores import available_cores

PYTHON = (3, 11)
CPU_FLAGS = ("avx2", "avx512f", "avx512_bf16", "avx512_fp16", "amx_bf16")

#: What a data set of the paper's size takes at 64 pixels, gigabytes.
FREE_DISK = 6

#: Of ``conf/scale``: objects, pairs of each, steps.
OBJECTS = 640
VIEWS = {"laptop": 100, "paper_640k": 1000}
STEPS = 40_000


def main() -> None:
    """Print the report as Markdown."""
    text, remedies = report()
    try:
        print(text, flush=True)
    except OSError as error:
        # Else Python tries once more when it ends, and complains in lines of its own.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(f"stereo_occ: <stdout>: {error.strerror}; let the report go where it can be written")
    sys.exit(1 if remedies else 0)


def report() -> tuple[str, list[str]]:
    """The report, and what is to be done."""
    remedies: list[str] = []
    rows, needed = machine(remedies), packages(remedies)
    rows += (
        [("the rest", "not tried; first see below")] if remedies else [*opengl(remedies), *speed(remedies)]
    )
    lines = [
        "### stereo_occ.doctor\n",
        *(f"- {name}: {value}" for name, value in rows),
        "\n| package | installed | needed |\n|---|---|---|",
        *(f"| {' | '.join(row)} |" for row in needed),
        "\nTo do:" if remedies else "\nAll that is needed is here.",
        *(f"- {remedy}" for remedy in remedies),
    ]
    return "\n".join(lines), remedies


def machine(remedies: list[str]) -> list[tuple[str, str]]:
    """System, Python, processor, memory, disk."""
    if sys.version_info < PYTHON:
        remedies.append(
            f"Python {platform.python_version()} is too old: install {'.'.join(map(str, PYTHON))} or later"
        )
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    note = "" if free > FREE_DISK else f"; scale=paper_640k needs {FREE_DISK} GB"
    model, flags, memory = _processor()
    return [
        ("system", platform.platform()),
        ("Python", f"{platform.python_version()} ({sys.executable})"),
        (
            "processor",
            f"{available_cores()} of {os.cpu_count()} cores; {model}; {flags or 'no ' + CPU_FLAGS[0]}",
        ),
        ("load", _load()),
        ("memory", memory),
        ("free disk here", f"{free:.0f} GB{note}"),
    ]


def packages(remedies: list[str]) -> list[tuple[str, str, str]]:
    """Name, installed and needed version of each package that this one needs."""
    try:
        needed = [line for line in requires("stereo-occ") or [] if "extra ==" not in line]
    except PackageNotFoundError:
        remedies.append("stereo-occ is not installed: make setup, or pip install -e . in its folder")
        return []
    rows, unfit = [], []
    for line in needed:
        name, bounds = re.match(r"([\w.-]+)\s*(.*)", line).groups()  # type: ignore[union-attr]
        try:
            installed = version(name)
        except PackageNotFoundError:
            installed = "missing"
        fits = installed != "missing" and all(_fits(installed, bound) for bound in bounds.split(","))
        if not fits:
            unfit.append(f"'{name}{bounds}'")
        rows.append((name, installed if fits else f"**{installed}**", bounds))
    if unfit:
        remedies.append(f"pip install {' '.join(unfit)}")
    return sorted(rows)


def opengl(remedies: list[str]) -> list[tuple[str, str]]:
    """What renders."""
    found = _probe("opengl")
    if "error" in found:
        remedies.append(found["error"])
        return [("OpenGL", "does not work")]
    return list(found.items())


def speed(remedies: list[str]) -> list[tuple[str, str]]:
    """Threads of torch, and how long the usual work takes."""
    rows = []
    train = _probe("train")
    if "error" in train:
        rows.append(("training", "does not work"))
        remedies.append(f"training: {train['error']}")
    else:
        rows.append(("torch", f"{train['threads']} threads; GPU: {train['gpu']}"))
        for precision, ms in train["ms_per_step"].items():
            hours = STEPS * ms / 3.6e6
            work = f"{STEPS:,} steps of model=stereo at scale=laptop ~ {hours:.1f} h"
            rows.append((f"training, {precision}", f"{ms:.0f} ms per step; {work}"))
    render: dict[str, Any] = _probe("render") if not remedies else {"error": ""}
    if "error" in render:
        rows.append(("rendering", "does not work"))
        remedies += [f"rendering: {render['error']}"] if render["error"] else []
    else:
        seconds = {name: render["object"] + views * render["pair"] for name, views in VIEWS.items()}
        minutes = {name: OBJECTS * each / available_cores() / 60 for name, each in seconds.items()}
        estimates = ", ".join(f"scale={name} ~ {value:.0f} min" for name, value in minutes.items())
        rows.append(
            ("rendering", f"{1 / render['pair']:.0f} pairs of 64 px a second on one core; {estimates}")
        )
    return rows


def _probe(what: str) -> dict[str, Any]:
    """What a process of :mod:`stereo_occ.probe` has found, or its ``error`` in one line."""
    environment = {**os.environ, "PYTHONWARNINGS": "ignore"}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "stereo_occ.probe", what],
            capture_output=True,
            text=True,
            timeout=300,
            env=environment,
            check=False,
        )
        if done.returncode == 0:
            return dict(json.loads(done.stdout.splitlines()[-1]))
        lines = done.stderr.strip().splitlines()
        return {"error": lines[-1] if lines else f"ended by signal {-done.returncode}"}
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError) as error:
        return {"error": str(error)}


def _load() -> str:
    load = os.getloadavg()[0]
    return f"{load:.1f} processes" + (
        " (busy: what follows would be faster alone)" if load > 0.5 * available_cores() else ""
    )


def _processor() -> tuple[str, str, str]:
    """Model, flags that matter, memory; of Linux."""
    try:
        about = Path("/proc/cpuinfo").read_text()
        kilobytes = Path("/proc/meminfo").read_text()
        model = re.search(r"model name\s*: (.*)", about)
        flags = re.search(r"flags\s*: (.*)", about)
        total, free = (re.search(rf"{key}:\s*(\d+)", kilobytes) for key in ("MemTotal", "MemAvailable"))
    except OSError:
        return platform.processor() or "unknown", "", "unknown"
    return (
        model[1] if model else platform.machine(),
        " ".join(flag for flag in CPU_FLAGS if flags and flag in flags[1].split()),
        f"{int(total[1]) / 1e6:.0f} GB, {int(free[1]) / 1e6:.0f} GB free" if total and free else "unknown",
    )


def _fits(installed: str, bound: str) -> bool:
    """Whether a version satisfies one bound of the simple kinds ``>=``, ``<`` and none."""
    match = re.match(r"\s*(>=|<)\s*([\w.]+)", bound)
    if not match:
        return True
    ours, limit = _numbers(installed), _numbers(match[2])
    return ours >= limit if match[1] == ">=" else ours < limit


def _numbers(text: str) -> tuple[int, ...]:
    """``2.17.7.post6`` as (2, 17, 7, 6), without zeros at the end and without what is behind a ``+``."""
    numbers = [int(number) for number in re.findall(r"\d+", text.partition("+")[0])]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


if __name__ == "__main__":
    main()
