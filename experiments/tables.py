"""The tables of the README and the docs, in Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from runs import (
    CATEGORIES,
    FIELD,
    FLOORS,
    HERE,
    MONO,
    RECIPE,
    REPEATED,
    RUNS,
    SHORT,
    load,
    metrics_of,
    rows_of,
    runs_of,
)

BASELINES = ("visual_hull", "sgm", "mean_shape", "nearest_shape", "truth")
PROBED = (300, 600, 900, 1200, 2100, 3000)  # steps
FULL = 40_000  # steps
#: Where the weights for photographs are measured.
BEFORE_CAMERAS = {
    "test": "test objects",
    "real": "real objects",
    "zed_mini": "real objects, ZED Mini",
    "realsense_d435": "real objects, RealSense D435",
    "photographs": "real objects, ZED Mini, among photographs",
}
#: Names of the recipe's runs in the tables of cost and of speed.
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


def trained() -> str:
    """IoU of each run's best state, with the settings of each row."""
    head = (
        "`python -m stereo_occ.train`", "parameters", "test `iou` (mug / bowl / bottle)", "`iou_bbox`",
        "`iou_unrotated`", "real objects, `iou`",
    )  # fmt: skip
    rows = []
    for folder, settings in RUNS.items():
        test, real = (load(folder / f"{where}.json") for where in ("test", "real"))
        metrics = test["metrics"]
        rows.append(
            [
                f"`{settings}`",
                f"{test['parameters'] / 1e6:.1f} M",
                _by_category(metrics),
                f"{metrics['test/iou_bbox']:.3f}",
                f"{metrics['test/iou_unrotated']:.3f}",
                f"{real['metrics']['test/iou']:.3f} ({real['objects']})",
            ]
        )
    return _markdown(head, rows)


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
    return _markdown(("model", "parameters, M", "encode, MMAC", "decode, MMAC"), rows)


def models() -> str:
    """What each model of the recipe costs and reaches."""
    head = (
        "model", "parameters", "MMAC", "ms per step", "minutes for 40,000", "test `iou` (mug / bowl / bottle)",
        "real `iou` (mug / bowl / bottle)",
    )  # fmt: skip
    cost, speed = (load(HERE / "speed" / f"{name}.json") for name in ("model_cost", "training_step"))
    rows = []
    for folder in runs_of(RECIPE):
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
                *(_by_category(metrics_of(folder, where)) for where in ("test", "real")),
            ]
        )
    return _markdown(head, rows)


def reached(family: Path) -> str:
    """What the runs of a family reach."""
    head = (
        "run", "test `iou` (mug / bowl / bottle)", "`iou_bbox`", "`f_score_2`", "`handle_recall`",
        "real `iou` (mug / bowl / bottle)",
    )  # fmt: skip
    rows = []
    for folder in runs_of(family):
        test, real = (metrics_of(folder, where) for where in ("test", "real"))
        values = (f"{test[f'test/{metric}']:.2f}" for metric in ("f_score_2", "handle_recall"))
        rows.append(
            [
                f"`{folder.name}`",
                _by_category(test),
                f"{test['test/iou_bbox']:.3f}",
                *values,
                _by_category(real),
            ]
        )
    return _markdown(head, rows)


def over_mono(family: Path, where: str, metrics: Sequence[str]) -> str:
    """What each run of a family has over its mono on ``test`` or ``real`` objects, with intervals."""
    results = load(HERE / "results.json")
    rows = []
    for folder in (folder for folder in runs_of(family) if folder.name != MONO):
        differences = results[f"{family.name}/{folder.name}"][where]["over mono_scratch"]
        for metric in metrics:
            name = f"`{folder.name}`" if metric == metrics[0] else ""
            rows.append([name, *_intervals(metric, differences[metric])])
    return _markdown(("", "", *CATEGORIES, "macro"), rows)


def field() -> str:
    """The weights for photographs before one camera and another."""
    head = ("", "`iou` (mug / bowl / bottle)", "`height_error`, `width_error`", "`handle_recall`")
    rows = []
    for where, name in BEFORE_CAMERAS.items():
        metrics = metrics_of(FIELD, where)
        errors = (f"{metrics[f'test/{side}_error'] * 1000:.0f} mm" for side in ("height", "width"))
        handles = metrics.get("test/handle_recall")
        rows.append(
            [name, _by_category(metrics), ", ".join(errors), "" if handles is None else f"{handles:.2f}"]
        )
    return _markdown(head, rows)


def seeds() -> str:
    """What the recipe reaches from one seed and another."""
    head = (
        "model",
        "seed",
        "test `iou` (mug / bowl / bottle)",
        "`iou_unrotated`",
        "`handle_recall`",
        "real `iou`",
    )
    rows = []
    for name, folders in REPEATED.items():
        for seed, folder in enumerate(folders):
            test, real = (metrics_of(folder, where) for where in ("test", "real"))
            rows.append(
                [
                    f"`{name}`" if seed == 0 else "",
                    str(seed),
                    _by_category(test),
                    f"{test['test/iou_unrotated']:.3f}",
                    f"{test['test/handle_recall']:.2f}",
                    f"{real['test/iou']:.3f}",
                ]
            )
    return _markdown(head, rows)


def over_mono_seeds() -> str:
    """What the repeated models have over mono, over objects and seeds."""
    results = load(HERE / "results.json")["seeds"]
    rows = []
    for name in (name for name in REPEATED if name != MONO):
        for where in ("test", "real"):
            for metric in ("iou", "iou_unrotated", "handle_recall"):
                found = results[name][where]["over mono_scratch"].get(metric)
                if found:
                    rows.append([f"`{name}`", where, *_intervals(metric, found)])
    return _markdown(("", "objects", "", *CATEGORIES, "macro"), rows)


def parts() -> str:
    """How much of thin parts, cavities and of both sides of the surface each run finds."""
    columns = {
        "handle": "handle_recall",
        "neck": "neck_recall",
        "mugs' cavity empty": "cavity_empty/mug",
        "bowls' cavity empty": "cavity_empty/bowl",
        "seen surface": "recall_2_visible",
        "hidden surface": "recall_2_occluded",
    }
    rows = []
    for folder in (folder for folder in RUNS if folder.parent != SHORT):
        test, real = (metrics_of(folder, where) for where in ("test", "real"))
        values = (f"{test[f'test/{metric}']:.2f}" for metric in columns.values())
        sides = (f"{real[f'test/recall_2_{side}']:.2f}" for side in ("visible", "occluded"))
        rows.append([f"`{folder.relative_to(HERE)}`", *values, " / ".join(sides)])
    return _markdown(("run", *columns, "real: seen / hidden"), rows)


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
    return _markdown(head, rows)


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
        rows.append([f"`{name}`", _by_category(test), *values, _by_category(real)])
    return _markdown(head, rows)


def decision() -> str:
    """One threshold for all pairs against one for each, chosen on validation objects."""
    rows = []
    for name, shown in (("recipe", "plane_sweep_guided, 10,000 steps"), ("field", "weights for photographs")):
        val, real = (load(HERE / "decision" / f"{name}_{where}.json") for where in ("val", "real"))
        for rule, by_threshold in val.items():
            threshold = max(by_threshold, key=lambda t: by_threshold[t]["macro"])
            values = (
                f"**{of['macro']:.3f}** ({_parts(of)})"
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
    return _markdown(head, rows)


def probes() -> str:
    """How one change moves the first steps."""
    head = ("changed", *(f"`iou` at {step:,}" for step in PROBED), "mug / bowl / bottle, last")
    rows = []
    for changed, by_step in _curves(HERE / "probes" / "probes.csv").items():
        shown = [by_step.get(step) for step in PROBED]
        values = (f"{float(row['iou']):.3f}" if row else "" for row in shown)
        rows.append([_changed(changed), *values, _parts([row for row in shown if row][-1])])
    return _markdown(head, rows)


def ablation() -> str:
    """What each training aid is worth at the end of a short schedule."""
    best = {
        changed: max(by_step.values(), key=lambda row: float(row["iou"]))
        for changed, by_step in _curves(HERE / "ablation" / "ablation.csv").items()
    }
    rows = []
    for changed, row in best.items():
        iou = float(row["iou"])
        against = f"{iou - float(best['']['iou']):+.3f}" if changed else ""
        rows.append([_changed(changed), f"{iou:.3f}", against, _parts(row), f"{float(row['iou_bbox']):.3f}"])
    return _markdown(
        ("changed", "`iou`", "against nothing changed", "mug / bowl / bottle", "`iou_bbox`"), rows
    )


def precision() -> str:
    """bfloat16 against float32, seed by seed."""
    best: dict[bool, list[float]] = {False: [], True: []}
    for changed, by_step in _curves(HERE / "precision" / "precision.csv").items():
        best["32-true" in changed].append(max(float(row["iou"]) for row in by_step.values()))
    rows = []
    for name, values in (
        ("`bf16-mixed`", best[False]),
        ("`32-true`", best[True]),
        ("difference", list(np.subtract(best[False], best[True]))),
    ):
        sign = "+" if name == "difference" else ""
        shown = (f"{value:{sign}.4f}" for value in (*values, np.mean(values), np.std(values, ddof=1)))
        rows.append([name, *shown])
    return _markdown(("", "seed 0", "seed 1", "seed 2", "mean", "standard deviation"), rows)


def _curves(path: Path) -> dict[str, dict[int, dict[str, str]]]:
    """Rows of a table of :mod:`changes` by what was changed and by step."""
    curves: dict[str, dict[int, dict[str, str]]] = {}
    for row in rows_of(path):
        curves.setdefault(row["changed"], {})[int(row["step"])] = row
    return curves


def _intervals(metric: str, found: Mapping[str, Sequence[float]]) -> list[str]:
    """The metric's name, and its value for each category and macro."""
    return [f"`{metric}`", *(_interval(found.get(column)) for column in (*CATEGORIES, "macro"))]


def _interval(value: Sequence[float] | None) -> str:
    return "" if value is None else f"{value[0]:+.3f} [{value[1]:.3f}, {value[2]:.3f}]"


def _minutes(ms_per_step: float) -> str:
    """Of the paper's schedule."""
    return f"{ms_per_step * FULL / 60_000:.0f}"


def _changed(changed: str) -> str:
    return f"`{changed}`" if changed else "nothing"


def _parts(row: Mapping[str, str | float]) -> str:
    return " / ".join(f"{float(row[category]):.2f}" for category in CATEGORIES)


def _by_category(metrics: Mapping[str, float]) -> str:
    parts = " / ".join(f"{metrics[f'test/iou/{category}']:.2f}" for category in CATEGORIES)
    return f"**{metrics['test/iou']:.3f}** ({parts})"


def _markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]])
