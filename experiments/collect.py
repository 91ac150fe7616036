"""Copy what the tables and figures need from a run folder: ``collect.py RUN DESTINATION``."""

import json
import shutil
import sys
from pathlib import Path
from typing import Any


def main(run: Path, destination: Path) -> None:
    destination.mkdir(parents=True, exist_ok=True)
    shutil.copy(run / "config.yaml", destination)
    shutil.copy(run / "metrics.json", destination / "training.json")
    curve: dict[int, dict[str, Any]] = {}
    for best in run.glob("*_best"):
        where = best.name.removesuffix("_best")
        shutil.copy(best / "metrics.json", destination / f"{where}.json")
        shutil.copy(best / "per_object.csv", destination / f"{where}_per_object.csv")
    for where in ("test", "real"):
        for path in (run / where).glob("*/metrics.json"):
            measured = json.loads(path.read_text())
            curve.setdefault(measured["step"], {})[where] = measured["metrics"]
    shutil.copytree(run / "test_best" / "pictures", destination / "pictures", dirs_exist_ok=True)
    if curve:
        steps = [{"step": step, **curve[step]} for step in sorted(curve)]
        (destination / "curve.json").write_text(json.dumps(steps, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
