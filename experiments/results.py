"""Make ``results.json``, the tables of the README and the docs and the figures from the committed result files.

Run by ``make results``. ``results.json`` has of every run ``[value, low, high]`` of its metrics per category and
macro, with the 95 % interval of the bootstrap over objects, and the paired difference from mono on the same recipe.
"""

import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from experiments import figures, path_traced_tables, run_tables, study_tables
from experiments.runs import (
    DISTANCES,
    FIELD,
    FREE,
    FREE_WHOLE,
    HERE,
    LONGER,
    MONO,
    RECIPE,
    REPEATED,
    RUNS,
    SEEDS,
    SURFACES,
    TWIN,
    WHOLE,
    WHOLE_SEEDS,
    load,
    rows_of,
    runs_of,
)
from stereo_occ.metrics.statistics import Difference, paired_bootstrap

PROJECT = HERE.parent
#: Pages and the tables in them, each between ``<!-- results:NAME -->`` and ``<!-- results:end -->``.
PAGES: dict[str, dict[str, Callable[[], str]]] = {
    "README.md": {"answer": run_tables.answer},
    "experiments/README.md": {"trained": run_tables.trained},
    "docs/metrics.md": {"decision": study_tables.decision, "floors": study_tables.floors},
    "docs/models.md": {
        "cost": study_tables.cost,
        "models": study_tables.models,
        "speed": study_tables.speed,
        "volumes": partial(study_tables.changed, HERE / "cost_volumes"),
    },
    "experiments/recipe_10k/README.md": {
        "over_mono": partial(run_tables.over_mono, RECIPE, "test", ("iou", "iou_unrotated", "handle_recall")),
        "parts": run_tables.parts,
    },
    "experiments/free_10k/README.md": {
        "reached": partial(run_tables.reached, FREE),
        "over_mono": partial(run_tables.over_mono, FREE, "test", ("iou", "handle_recall")),
        "over_mono_real": partial(run_tables.over_mono, FREE, "real", ("iou",)),
        "pair": partial(
            run_tables.less,
            {
                "test objects": FREE / "guided_against_its_mono",
                "real objects": FREE / "guided_against_its_mono_real",
            },
            ("iou", "recall_2_visible", "recall_2_occluded"),
        ),
    },
    "experiments/free_40k/README.md": {
        "reached": partial(run_tables.reached, FREE_WHOLE),
        "over_mono": partial(run_tables.over_mono, FREE_WHOLE, "test", ("iou", "handle_recall")),
        "over_mono_real": partial(run_tables.over_mono, FREE_WHOLE, "real", ("iou",)),
        "quarter": partial(
            run_tables.less,
            {
                f"`{folder.name}`": folder.with_name(f"{folder.name}_against_quarter")
                for folder in runs_of(FREE_WHOLE)
            },
            ("iou",),
        ),
    },
    "experiments/seeds_10k/README.md": {
        "seeds": partial(run_tables.seeds, SEEDS),
        "over_mono_seeds": partial(run_tables.over_mono_seeds, SEEDS),
        "pair": partial(
            run_tables.over_seeds,
            SEEDS,
            TWIN,
            ["plane_sweep_guided"],
            ("iou", "recall_2_visible", "recall_2_occluded", "handle_recall"),
        ),
    },
    "experiments/seeds_40k/README.md": {
        "seeds": partial(run_tables.seeds, WHOLE_SEEDS),
        "over_mono_seeds": partial(run_tables.over_mono_seeds, WHOLE_SEEDS),
    },
    "experiments/field/README.md": {
        "field": run_tables.field,
        "less_before": partial(
            run_tables.less,
            {"real objects, ZED Mini": FIELD / "zed_mini_against_before"},
            ("iou", "height_error", "width_error"),
        ),
    },
    "experiments/field_surfaces/README.md": {
        "surfaces": run_tables.surfaces,
        "less": partial(
            run_tables.less,
            {
                "glossy, plain less matt, plain": SURFACES / "glossy_none-plain_none",
                "matt, patterned less matt, plain": SURFACES / "plain_procedural-plain_none",
                "glossy, patterned less glossy, plain": SURFACES / "glossy_procedural-glossy_none",
            },
            ("iou", "recall_2_visible"),
        ),
    },
    "experiments/field_distance/README.md": {
        "distances": run_tables.distances,
        "wider": partial(
            run_tables.less,
            {
                f"12 cm less 6.3 cm, at {at} m": DISTANCES / f"wider_{at}"
                for at in ("0.35", "0.5", "0.7", "1.0")
            },
            ("iou",),
        ),
    },
    "experiments/path_traced/README.md": {
        "reached": path_traced_tables.reached,
        "less_before": path_traced_tables.less_before,
        "looks": path_traced_tables.looks,
    },
    "experiments/image_side/README.md": {"sides": partial(study_tables.changed, HERE / "image_side")},
    "experiments/baseline_angle/README.md": {
        "angles": partial(study_tables.changed, HERE / "baseline_angle")
    },
    "experiments/surfaces/README.md": {"trained_surfaces": study_tables.trained_surfaces},
    "experiments/recipe_20k/README.md": {
        "half": partial(
            run_tables.less,
            {"test objects": LONGER / "half_the_schedule", "real objects": LONGER / "half_the_schedule_real"},
            ("iou",),
        ),
        "reached": partial(run_tables.reached, LONGER),
    },
    "experiments/recipe_40k/README.md": {
        "reached": partial(run_tables.reached, WHOLE),
        "over_mono": partial(run_tables.over_mono, WHOLE, "test", ("iou", "iou_unrotated", "handle_recall")),
        "over_mono_real": partial(run_tables.over_mono, WHOLE, "real", ("iou", "iou_unrotated")),
        "pair": partial(
            run_tables.less,
            {
                "test objects": WHOLE / "guided_against_its_mono",
                "real objects": WHOLE / "guided_against_its_mono_real",
            },
            ("iou", "recall_2_visible", "recall_2_occluded"),
        ),
        "quarter": partial(
            run_tables.less,
            {
                f"`{folder.name}`, {where} objects": folder.with_name(
                    f"{folder.name}_against_quarter{suffix}"
                )
                for folder in runs_of(WHOLE)
                for where, suffix in (("test", ""), ("real", "_real"))
            },
            ("iou",),
        ),
    },
    "docs/experiments.md": {
        "controls": study_tables.controls,
        "probes": study_tables.probes,
        "ablation": partial(study_tables.changed, HERE / "ablation"),
        "precision": study_tables.precision,
    },
}
WITH_INTERVALS = (
    "iou", "iou_bbox", "iou_unrotated", "handle_recall", "neck_recall", "cavity_empty", "chamfer_l1",
    "recall_2_visible", "recall_2_occluded", "height_error", "width_error",
)  # fmt: skip


def summary() -> dict[str, Any]:
    """Every run's metrics with their intervals, and what it has over mono."""
    runs: dict[str, Any] = {}
    for folder in (*RUNS, FIELD):
        mono = folder.with_name(MONO)
        run: dict[str, Any] = {"settings": RUNS.get(folder, "experiment=field")}
        for where in ("test", "real"):
            facts = load(folder / f"{where}.json")
            run["parameters"] = facts["parameters"]
            run[where] = {"objects": facts["objects"], "metrics": _differences([folder], [], where)}
            if mono in RUNS and folder != mono:
                run[where]["over mono_scratch"] = _differences([folder], [mono], where)
        runs[str(folder.relative_to(HERE))] = run
    for family, repeated in REPEATED.items():
        runs[family.name] = {
            name: {
                where: {
                    "metrics": _differences(folders, [], where),
                    **{
                        f"over {other}": _differences(folders, repeated[other], where)
                        for other in (MONO, TWIN)
                        if other != name and other in repeated
                    },
                }
                for where in ("test", "real")
            }
            for name, folders in repeated.items()
            if name != MONO
        }
    return runs


def _differences(
    ours: list[Path], theirs: list[Path], where: str
) -> dict[str, dict[str, list[float | None]]]:
    """Of each metric our runs less theirs, or ours alone, per category and macro: value, low, high."""
    a_S, b_T = ([_by_view(run / f"{where}_per_object.csv") for run in runs] for runs in (ours, theirs))
    found: dict[str, dict[str, list[float | None]]] = {}
    for metric in WITH_INTERVALS:
        keys = [key for key, row in a_S[0].items() if row.get(metric)]
        if not keys:
            continue
        a_SV, b_TV = (
            np.array([[float(run[key][metric]) for key in keys] for run in side]) for side in (a_S, b_T)
        )
        if not b_T:
            b_TV = np.zeros((1, len(keys)))
        differences = paired_bootstrap(a_SV, b_TV, [key[0] for key in keys], [key[1] for key in keys])
        found[metric] = {name: _rounded(difference) for name, difference in differences.items()}
    return found


def _by_view(path: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    """By category, object and view."""
    return {(row["category"], row["object_id"], row["view"]): row for row in rows_of(path)}


def _rounded(value: Difference) -> list[float | None]:
    return [None if x is None else round(x, 6) for x in (value.difference, value.low, value.high)]


def fill(page: Path, name: str, text: str) -> None:
    """Put a table into its place on a page."""
    block = re.compile(rf"(<!-- results:{name} -->\n).*?(?=<!-- results:end -->)", re.DOTALL)
    filled, count = block.subn(lambda match: f"{match[1]}{text}\n", page.read_text())
    if count != 1:
        raise SystemExit(f"{page}: {count} places for the table {name!r}, not 1")
    page.write_text(filled)


def main() -> None:
    (HERE / "results.json").write_text(json.dumps(summary(), indent=1) + "\n")
    figures.curves()
    for family in (RECIPE, WHOLE, FREE_WHOLE):
        figures.recipe_curves(family)
    figures.examples(WHOLE / "plane_sweep_guided")
    for page, made in PAGES.items():
        for name, table in made.items():
            fill(PROJECT / page, name, table())


if __name__ == "__main__":
    main()
