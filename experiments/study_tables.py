"""The tables of what models cost, of what needs no training and of one change at a time."""

from pathlib import Path

import numpy as np

from experiments import cells
from experiments.runs import FLOORS, HERE, RECIPE, load, metrics_of, rows_of, runs_of

BASELINES = ("visual_hull", "sgm", "mean_shape", "nearest_shape", "truth")
CONTROLS = (
    "none",
    "calibration_off_0.5",
    "calibration_off_1",
    "calibration_off_2",
    "left_twice",
    "right_shuffled",
)
PROBED = (300, 600, 900, 1200, 2100, 3000)  # steps
FULL = 40_000  # steps
#: Names of the recipe's runs in the tables of cost and of speed, those that are there.
COSTS = {
    "mono_scratch": ("mono, resnet18", "mono"),
    "plane_sweep_mono_aided": ("plane_sweep_mono", "plane_sweep_mono"),
    "stereo": ("stereo, correlation", "stereo"),
    "stereo_signed": ("stereo, correlation_signed", "stereo_signed"),
    "pixel_stereo": ("pixel_stereo", "pixel_stereo"),
    "plane_sweep_stereo": ("plane_sweep_stereo", "plane_sweep_stereo"),
    "plane_sweep_stereo_aided": ("plane_sweep_stereo", "plane_sweep_stereo"),
    "plane_sweep_guided": ("plane_sweep_guided", "plane_sweep_guided"),
}


def cost() -> str:
    """Size and operations of every model."""
    rows = [
        [
            name,
            f"{size['parameters'] / 1e6:.2f}",
            *(f"{size[f'{part}_mmac']:.0f}" for part in ("encode", "decode")),
        ]
        for name, size in load(HERE / "speed" / "model_cost.json").items()
    ]
    return cells.table(("model", "parameters, M", "encode, MMAC", "decode, MMAC"), rows)


def models() -> str:
    """What each model of the recipe costs and reaches."""
    head = (
        "model", "parameters", "MMAC", "ms per step", "minutes for 40,000", "test `iou` (mug / bowl / bottle)",
        "real `iou` (mug / bowl / bottle)",
    )  # fmt: skip
    cost, speed = (load(HERE / "speed" / f"{name}.json") for name in ("model_cost", "training_step"))
    rows = []
    for folder in (folder for folder in runs_of(RECIPE) if folder.name in COSTS):
        of_cost, of_speed = COSTS[folder.name]
        size = cost[of_cost]
        ms = speed[of_speed]["bf16_ms"]
        rows.append(
            [
                f"`{folder.name}`",
                f"{size['parameters'] / 1e6:.1f} M",
                f"{size['encode_mmac'] + size['decode_mmac']:.0f}",
                f"{ms:.0f}",
                _minutes(ms),
                *(cells.iou(metrics_of(folder, where)) for where in ("test", "real")),
            ]
        )
    return cells.table(head, rows)


def speed() -> str:
    """Milliseconds of a training step beside a plain reference's."""
    measured = load(HERE / "speed" / "training_step.json")
    head = (
        "model", "reference", "fp32", "bf16", "times as fast", "40,000 steps in bf16",
        "operations alone, at the rate of a bf16 matrix product",
    )  # fmt: skip
    rows = []
    for name in (name for name, values in measured.items() if isinstance(values, dict)):
        values = measured[name]
        reference, fp32, bf16 = (values[f"{way}_ms"] for way in ("reference", "fp32", "bf16"))
        rows.append(
            [
                f"`{name}`",
                *(f"{ms:.0f} ms" for ms in (reference, fp32, bf16)),
                f"{reference / bf16:.1f}",
                f"{_minutes(bf16)} min",
                f"{values['floor_ms']:.0f} ms",
            ]
        )
    return cells.table(head, rows)


def floors() -> str:
    """What needs no training."""
    columns = ("iou_bbox", "iou_unrotated", "chamfer_l1", "f_score_2", "cavity_empty", "handle_recall")
    head = (
        "baseline", "test `iou` (mug / bowl / bottle)", *(f"`{name}`" for name in columns), "real `iou`",
    )  # fmt: skip
    rows = []
    for name in BASELINES:
        test, real = (metrics_of(FLOORS / name, where) for where in ("test", "real"))
        values = (f"{test[f'test/{column}']:.3f}" for column in columns)
        rows.append([f"`{name}`", cells.iou(test), *values, cells.iou(real)])
    return cells.table(head, rows)


def controls() -> str:
    """What a network makes of pairs from which something is taken that it was trained with."""
    rows = []
    for control in CONTROLS:
        metrics = load(HERE / "controls" / f"{control}.json")["metrics"]
        rows.append([f"`{control}`", cells.iou(metrics), f"{metrics['test/handle_recall']:.2f}"])
    return cells.table(("control", "`iou` (mug / bowl / bottle)", "`handle_recall`"), rows)


def decision() -> str:
    """One threshold for all pairs against one for each, chosen on validation objects."""
    rows = []
    for name, shown in (("recipe", "plane_sweep_guided, 10,000 steps"), ("field", "weights for photographs")):
        val, real = (load(HERE / "decision" / f"{name}_{where}.json") for where in ("val", "real"))
        for rule, by_threshold in val.items():
            threshold = max(by_threshold, key=lambda t: by_threshold[t]["macro"])
            values = (
                f"**{of['macro']:.3f}** ({cells.parts(of)})"
                for of in (by_threshold[threshold], real[rule][threshold])
            )
            rows.append([shown if rule == "fixed" else "", f"`{rule}`", threshold, *values])
    head = (
        "",
        "decision",
        "threshold",
        "validation `iou` (mug / bowl / bottle)",
        "real `iou` (mug / bowl / bottle)",
    )
    return cells.table(head, rows)


def probes() -> str:
    """How one change moves the first steps."""
    head = ("changed", *(f"`iou` at {step:,}" for step in PROBED), "mug / bowl / bottle, last")
    rows = []
    for changed, by_step in _curves(HERE / "probes" / "probes.csv").items():
        shown = [by_step.get(step) for step in PROBED]
        values = (f"{float(row['iou']):.3f}" if row else "" for row in shown)
        rows.append([_changed(changed), *values, cells.parts([row for row in shown if row][-1])])
    return cells.table(head, rows)


def changed(family: Path) -> str:
    """What one change each does at the end of a short schedule."""
    best = _best(family)
    rows = []
    for change, row in best.items():
        iou = float(row["iou"])
        against = f"{iou - float(best['']['iou']):+.3f}" if change else ""
        rows.append(
            [_changed(change), f"{iou:.3f}", against, cells.parts(row), f"{float(row['iou_bbox']):.3f}"]
        )
    return cells.table(
        ("changed", "`iou`", "against nothing changed", "mug / bowl / bottle", "`iou_bbox`"), rows
    )


def trained_surfaces() -> str:
    """What surfaces do to the pair's lead over mono, both trained on them."""
    best = {frozenset(told.split()): float(row["iou"]) for told, row in _best(HERE / "surfaces").items()}
    rows = []
    for shown, surface in (
        ("matt, plain", set()),
        ("matt, patterned", {"texture=procedural"}),
        ("glossy, plain", {"material=glossy"}),
        ("glossy, patterned", {"texture=procedural", "material=glossy"}),
    ):
        pair, one = (best[frozenset(surface | model)] for model in (set(), {"model=mono_scratch"}))
        rows.append([shown, f"{pair:.3f}", f"{one:.3f}", f"{pair - one:+.3f}"])
    return cells.table(("surfaces", "`plane_sweep_stereo`", "`mono_scratch`", "difference"), rows)


def precision() -> str:
    """bfloat16 against float32, seed by seed."""
    best: dict[bool, list[float]] = {False: [], True: []}
    for changed, row in _best(HERE / "precision").items():
        best["32-true" in changed].append(float(row["iou"]))
    rows = []
    for name, values in (
        ("`bf16-mixed`", best[False]),
        ("`32-true`", best[True]),
        ("difference", list(np.subtract(best[False], best[True]))),
    ):
        sign = "+" if name == "difference" else ""
        shown = (f"{value:{sign}.4f}" for value in (*values, np.mean(values), np.std(values, ddof=1)))
        rows.append([name, *shown])
    return cells.table(("", "seed 0", "seed 1", "seed 2", "mean", "standard deviation"), rows)


def _curves(path: Path) -> dict[str, dict[int, dict[str, str]]]:
    """Rows of a table of :mod:`changes` by what was changed and by step."""
    curves: dict[str, dict[int, dict[str, str]]] = {}
    for row in rows_of(path):
        curves.setdefault(row["changed"], {})[int(row["step"])] = row
    return curves


def _best(family: Path) -> dict[str, dict[str, str]]:
    """By what was changed, the best validation of each run of a family."""
    return {
        change: max(by_step.values(), key=lambda row: float(row["iou"]))
        for change, by_step in _curves(family / f"{family.name}.csv").items()
    }


def _changed(changed: str) -> str:
    return f"`{changed}`" if changed else "nothing"


def _minutes(ms_per_step: float) -> str:
    """Of the paper's schedule."""
    return f"{ms_per_step * FULL / 60_000:.0f}"
