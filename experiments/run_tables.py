"""The tables of what trained models reach."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from experiments import cells
from experiments.runs import (
    CATEGORIES,
    DISTANCES,
    FIELD,
    FREE_WHOLE,
    HERE,
    MONO,
    REPEATED,
    RUNS,
    SURFACES,
    TWIN,
    WHOLE,
    load,
    metrics_of,
    runs_of,
)

#: Where the weights for photographs are measured.
BEFORE_CAMERAS = {
    "test": "test objects",
    "real": "real objects",
    "zed_mini": "real objects, ZED Mini",
    "realsense_d435": "real objects, RealSense D435",
    "photographs": "real objects, ZED Mini, among photographs",
}
#: Looks of the objects with which the weights for photographs are measured.
LOOKS = {
    "plain_none": "matt, plain",
    "plain_procedural": "matt, patterned",
    "glossy_none": "glossy, plain",
    "glossy_procedural": "glossy, patterned",
}

#: Rows of the answer to the paper's question: the name of the run, and what a reader is told of it.
ASKED = {
    MONO: "one view: ResNet-18, from scratch",
    TWIN: "one view: the network of the last row without its second view",
    "stereo": "a pair: the paper's stereo network",
    "plane_sweep_guided": "a calibrated pair: `plane_sweep_guided`",
}


def answer() -> str:
    """What the paper asks, on its whole schedule: object as it is placed there, and anywhere in view."""
    head = (
        "40,000 iterations", "`iou` (mug / bowl / bottle)", "over ResNet-18", "real objects",
        "anywhere, of any size: `iou`", "over ResNet-18", "real objects",
    )  # fmt: skip
    results = load(HERE / "results.json")
    rows = []
    for name, text in ASKED.items():
        row = [text]
        for family in (WHOLE, FREE_WHOLE):
            if family / name not in RUNS:
                row += ["", "", ""]
                continue
            over = results[f"{family.name}/{name}"]["test"].get(f"over {MONO}")
            real = metrics_of(family / name, "real")["test/iou"]
            row += [
                cells.iou(metrics_of(family / name)),
                cells.interval(over and over["iou"]["macro"]),
                f"{real:.3f}",
            ]
        rows.append(row)
    return cells.table(head, rows)


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
                cells.iou(metrics),
                f"{metrics['test/iou_bbox']:.3f}",
                f"{metrics['test/iou_unrotated']:.3f}",
                f"{real['metrics']['test/iou']:.3f}",
            ]
        )
    return cells.table(head, rows)


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
                cells.iou(test),
                f"{test['test/iou_bbox']:.3f}",
                *values,
                cells.iou(real),
            ]
        )
    return cells.table(head, rows)


def over_mono(family: Path, where: str, metrics: Sequence[str]) -> str:
    """What each run of a family has over its mono on ``test`` or ``real`` objects, with intervals."""
    results = load(HERE / "results.json")
    rows = []
    for folder in (folder for folder in runs_of(family) if folder.name != MONO):
        differences = results[f"{family.name}/{folder.name}"][where]["over mono_scratch"]
        for metric in metrics:
            name = f"`{folder.name}`" if metric == metrics[0] else ""
            rows.append([name, *cells.intervals(metric, differences[metric])])
    return cells.table(("", "", *CATEGORIES, "macro"), rows)


def surfaces() -> str:
    """The weights for photographs on the same objects with four looks."""
    head = ("", "`iou` (mug / bowl / bottle)", "seen surface found", "`height_error`, `width_error`")
    rows = []
    for look, name in LOOKS.items():
        metrics = load(SURFACES / f"{look}.json")["metrics"]
        rows.append(
            [name, cells.iou(metrics), f"{metrics['test/recall_2_visible']:.3f}", cells.size(metrics)]
        )
    return cells.table(head, rows)


def distances() -> str:
    """The weights for photographs near and far, with cameras close together and farther apart."""
    head = (
        "between the cameras", "to the object", "real `iou` (mug / bowl / bottle)", "seen surface found",
        "`height_error`, `width_error`",
    )  # fmt: skip
    rows = []
    for path in sorted(DISTANCES.glob("*.json")):
        baseline, distance = map(float, path.stem.split("_"))
        metrics = load(path)["metrics"]
        rows.append(
            [
                f"{baseline * 100:.1f} cm",
                f"{distance * 100:.0f} cm",
                cells.iou(metrics),
                f"{metrics['test/recall_2_visible']:.2f}",
                cells.size(metrics),
            ]
        )
    return cells.table(head, rows)


def seeds(family: Path) -> str:
    """What the runs that a family repeats reach from one seed and another."""
    head = (
        "model",
        "seed",
        "test `iou` (mug / bowl / bottle)",
        "`iou_unrotated`",
        "`handle_recall`",
        "real `iou`",
    )
    rows = []
    for name, folders in REPEATED[family].items():
        for seed, folder in enumerate(folders):
            test, real = (metrics_of(folder, where) for where in ("test", "real"))
            rows.append(
                [
                    f"`{name}`" if seed == 0 else "",
                    str(seed),
                    cells.iou(test),
                    f"{test['test/iou_unrotated']:.3f}",
                    f"{test['test/handle_recall']:.2f}",
                    f"{real['test/iou']:.3f}",
                ]
            )
    return cells.table(head, rows)


def over_mono_seeds(family: Path) -> str:
    """What the repeated models of a family have over mono."""
    names = [name for name in REPEATED[family] if name != MONO]
    return over_seeds(family, MONO, names, ("iou", "iou_unrotated", "handle_recall"))


def over_seeds(family: Path, base: str, names: Sequence[str], metrics: Sequence[str]) -> str:
    """What repeated models have over one of them, over objects and seeds."""
    results = load(HERE / "results.json")[family.name]
    rows = []
    for name in names:
        for where in ("test", "real"):
            for metric in metrics:
                found = results[name][where][f"over {base}"].get(metric)
                if found:
                    rows.append([f"`{name}`", where, *cells.intervals(metric, found)])
    return cells.table(("", "objects", "", *CATEGORIES, "macro"), rows)


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
    for folder in RUNS:
        test, real = (metrics_of(folder, where) for where in ("test", "real"))
        values = (f"{test[f'test/{metric}']:.2f}" for metric in columns.values())
        sides = (f"{real[f'test/recall_2_{side}']:.2f}" for side in ("visible", "occluded"))
        rows.append([f"`{folder.relative_to(HERE)}`", *values, " / ".join(sides)])
    return cells.table(("run", *columns, "real: seen / hidden"), rows)


def field() -> str:
    """The weights for photographs before one camera and another."""
    head = ("", "`iou` (mug / bowl / bottle)", "`height_error`, `width_error`", "`handle_recall`")
    rows = []
    for where, name in BEFORE_CAMERAS.items():
        metrics = metrics_of(FIELD, where)
        handles = metrics.get("test/handle_recall")
        rows.append(
            [name, cells.iou(metrics), cells.size(metrics), "" if handles is None else f"{handles:.2f}"]
        )
    return cells.table(head, rows)


def less(folders: Mapping[str, Path], metrics: Sequence[str]) -> str:
    """What one evaluation has over another, by the names of the rows; lengths are in millimetres."""
    rows = []
    for name, folder in folders.items():
        results = load(folder / "comparison.json")["results"]
        for metric in metrics:
            length = metric.endswith("_error")
            scale, digits = (1000, 0) if length else (1, 3)
            found = (results[metric].get(place) for place in (*CATEGORIES, "macro"))
            bounds = (of and [of[bound] * scale for bound in ("difference", "low", "high")] for of in found)
            rows.append(
                [
                    name if metric == metrics[0] else "",
                    f"`{metric}`" + (", mm" if length else ""),
                    *(cells.interval(bound, digits) for bound in bounds),
                ]
            )
    return cells.table(("", "", *CATEGORIES, "macro"), rows)
