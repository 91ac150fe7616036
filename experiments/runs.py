"""The committed runs: where their files are and how each was made."""

import csv
import json
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
FLOORS = HERE / "floors"
SHORT, RECIPE, LONGER, WHOLE, FREE, FREE_WHOLE, SEEDS, WHOLE_SEEDS, FIELD, SURFACES, DISTANCES = (
    HERE / name
    for name in (
        "laptop_4k",
        "recipe_10k",
        "recipe_20k",
        "recipe_40k",
        "free_10k",
        "free_40k",
        "seeds_10k",
        "seeds_40k",
        "field",
        "field_surfaces",
        "field_distance",
    )
)
AID = "auxiliary=mask_depth"
AIDED = f"model=plane_sweep_stereo {AID}"
GUIDED = f"model=plane_sweep_guided {AID}"
#: Settings of each run; those of a family are compared with its :data:`MONO`.
RUNS = {
    RECIPE / "mono_scratch": "experiment=recipe model=mono_scratch steps=10000",
    RECIPE / "stereo": "experiment=recipe model=stereo steps=10000",
    RECIPE / "stereo_signed": "experiment=recipe model=stereo_signed steps=10000",
    RECIPE / "pixel_stereo": "experiment=recipe model=pixel_stereo steps=10000",
    RECIPE / "plane_sweep_mono_aided": f"experiment=recipe model=plane_sweep_mono {AID} steps=10000",
    RECIPE / "plane_sweep_stereo": "experiment=recipe model=plane_sweep_stereo steps=10000",
    RECIPE / "plane_sweep_stereo_aided": f"experiment=recipe {AIDED} steps=10000",
    RECIPE / "plane_sweep_guided": f"experiment=recipe {GUIDED} steps=10000",
    RECIPE / "plane_sweep_guided_left": f"experiment=recipe {GUIDED} model.views=left steps=10000",
    LONGER / "plane_sweep_stereo_aided": f"experiment=recipe {AIDED} steps=20000",
    WHOLE / "mono_scratch": "experiment=recipe model=mono_scratch scale.batch_size=8",
    WHOLE / "stereo": "experiment=recipe model=stereo scale.batch_size=8",
    WHOLE / "stereo_signed": "experiment=recipe model=stereo_signed scale.batch_size=8",
    WHOLE / "pixel_stereo": "experiment=recipe model=pixel_stereo scale.batch_size=8",
    WHOLE / "plane_sweep_stereo": "experiment=recipe model=plane_sweep_stereo scale.batch_size=8",
    WHOLE / "plane_sweep_guided_left": f"experiment=recipe {GUIDED} model.views=left scale.batch_size=8",
    WHOLE / "plane_sweep_guided": f"experiment=recipe {GUIDED} scale.batch_size=8",
    FREE / "mono_scratch": "experiment=recipe placement=free model=mono_scratch steps=10000",
    FREE / "stereo": "experiment=recipe placement=free model=stereo steps=10000",
    FREE / "plane_sweep_stereo_aided": f"experiment=recipe placement=free {AIDED} steps=10000",
    FREE / "plane_sweep_guided": f"experiment=recipe placement=free {GUIDED} steps=10000",
    FREE
    / "plane_sweep_guided_left": f"experiment=recipe placement=free {GUIDED} model.views=left steps=10000",
    FREE_WHOLE / "mono_scratch": "experiment=recipe placement=free model=mono_scratch scale.batch_size=8",
    FREE_WHOLE / "stereo": "experiment=recipe placement=free model=stereo scale.batch_size=8",
    FREE_WHOLE / "plane_sweep_guided": f"experiment=recipe placement=free {GUIDED} scale.batch_size=8",
}
MONO = "mono_scratch"
TWIN = "plane_sweep_guided_left"
#: Runs trained again from other seeds: by family of the others and name, each training of it, seed 0 first.
REPEATED = {
    others: {name: [first / name, *(others / f"{name}_{seed}" for seed in seeds)] for name, seeds in names}
    for others, first, names in (
        (SEEDS, RECIPE, ((MONO, (1, 2)), ("stereo", (1, 2)), (TWIN, (1,)), ("plane_sweep_guided", (1, 2)))),
        (WHOLE_SEEDS, WHOLE, ((MONO, (1,)), ("stereo", ()), ("plane_sweep_guided", ()))),
    )
}
CATEGORIES = ("mug", "bowl", "bottle")


def runs_of(family: Path) -> list[Path]:
    """Folders of the runs of a family."""
    return [folder for folder in RUNS if folder.parent == family]


def load(path: Path) -> Any:
    """What a JSON file holds."""
    return json.loads(path.read_text())


def metrics_of(folder: Path, where: str = "test") -> dict[str, float]:
    """Mean metrics of a run or a baseline on ``test`` or ``real`` objects."""
    metrics: dict[str, float] = load(folder / f"{where}.json")["metrics"]
    return metrics


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
