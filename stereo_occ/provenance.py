"""What a number came from: code, versions, hardware, objects."""

import hashlib
import json
import platform
import subprocess
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import torch

from stereo_occ import __version__
from stereo_occ.data.objects import ObjectSource
from stereo_occ.paths import PACKAGE

#: Version of what the metrics mean (``docs/metrics.md``): results of different versions are not compared.
PROTOCOL = 1

#: Form of ``metrics.json``.
SCHEMA = 2

#: Packages that decide results beside torch.
PACKAGES = ("numpy", "scipy", "torchvision", "lightning", "trimesh", "embreex", "manifold3d", "scikit-image")
OPTIONAL_PACKAGES = ("opencv-python-headless", "timm")


def environment() -> dict[str, Any]:
    """Code, versions and hardware, for every results file."""
    return {
        "schema": SCHEMA,
        "protocol": PROTOCOL,
        "stereo_occ": __version__,
        **commit(),
        "torch": torch.__version__,
        "python": platform.python_version(),
        "packages": packages(),
        "cpu": cpu_model(),
        "threads": torch.get_num_threads(),
    }


def commit(package: Path = PACKAGE) -> dict[str, Any]:
    """``commit`` and whether code, settings or weights differ from it (``dirty``); both None outside of a checkout.

    Pages and results do not count: one command may write several results.
    """
    own_file = f"{package.name}/__init__.py"
    if _git(package.parent, "ls-files", "--error-unmatch", own_file) is None:
        return {"commit": None, "dirty": None}
    deciding = package.name, "conf", "*.py", "requirements.lock"
    changes = _git(package.parent, "status", "--porcelain", "--untracked-files=no", "--", *deciding)
    return {"commit": _git(package.parent, "rev-parse", "HEAD"), "dirty": changes != ""}


def packages() -> dict[str, str]:
    """Versions of the packages that decide results, of optional ones where they are installed."""
    versions = {name: version(name) for name in PACKAGES}
    for name in OPTIONAL_PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions


def split_hash(training: Sequence[ObjectSource], evaluated: Sequence[ObjectSource]) -> str:
    """The same for the same training objects and the same evaluated ones, whatever their order."""
    names = [
        sorted("/".join((*source.key, source.version)) for source in side) for side in (training, evaluated)
    ]
    return hashlib.sha256(json.dumps(names).encode()).hexdigest()[:16]


def cpu_model() -> str:
    """The processor's own name where the system tells it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")),
        platform.machine(),
    )


def _git(folder: Path, *arguments: str) -> str | None:
    """What git says, None if it is not there or refuses."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=20, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
