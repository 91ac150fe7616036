"""``python -m stereo_occ.compare A B``: is A better than B, on the same objects, views and points?

A and B are folders of evaluations, or patterns that name one folder per training seed, such as
``'outputs/evaluate/stereo_*'``. The table goes to the terminal; ``comparison.json`` and ``comparison.png`` go into the
folder of ``--output``.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from stereo_occ.comparison_plot import forest_plot
from stereo_occ.errors import UserError
from stereo_occ.evaluation_rows import Evaluations, find_evaluations, read_evaluations
from stereo_occ.metrics.statistics import Difference, paired_bootstrap
from stereo_occ.metrics.summary import METRICS
from stereo_occ.model_settings import model_settings
from stereo_occ.printable import printable
from stereo_occ.provenance import environment
from stereo_occ.system_errors import one_line
from stereo_occ.watched_output import watched_output
from stereo_occ.writing import write_json

#: What both sides must have been measured with, as named in ``metrics.json``.
SAME = ("protocol", "subset", "views", "points", "meshes")

#: What may differ and is then said.
NOTED = ("split", "commit", "data")

LEVEL = 0.95

#: Of the bootstrap: 2.4 GB for a category of a thousand objects.
MOST_DRAWS = 100_000

RECORD, PLOT = "comparison.json", "comparison.png"

Results = dict[str, dict[str, Difference]]


def compare(
    a: Evaluations, b: Evaluations, metrics: Sequence[str] | None, draws: int, seed: int = 0
) -> Results:
    """A - B of each metric, per category and macro.

    Args:
        metrics: those wanted; None is all that both sides have.

    Raises:
        UserError: they were not measured on the same objects and views in the same way, or lack a metric.
    """
    check_alike(a, b)
    shared = [name for name in METRICS if name in a.values and name in b.values]
    for name in metrics or ():
        if name not in shared:
            raise UserError(f"--metrics {name}: not in both results; both have {', '.join(shared)}")
    results: Results = {}
    for name in metrics or shared:
        a_SV, b_TV = a.values[name], b.values[name]
        has_RV = np.isfinite(np.concatenate([a_SV, b_TV]))
        known_V, applies_V = np.asarray(has_RV.all(axis=0)), np.asarray(has_RV.any(axis=0))
        if (known_V != applies_V).any():
            key = a.keys[int(np.argmax(known_V != applies_V))]
            raise UserError(
                f"{name}: {'/'.join(map(str, key))} has a value in one result and none in another"
            )
        if known_V.any():
            keys = [key for key, known in zip(a.keys, known_V, strict=True) if known]
            results[name] = paired_bootstrap(
                a_SV[:, known_V],
                b_TV[:, known_V],
                [key[0] for key in keys],
                [key[1] for key in keys],
                draws,
                LEVEL,
                seed,
            )
    return results


def table(results: Results) -> str:
    """One line per metric and category; a star marks an interval that leaves out 0."""
    head = f"{'metric':20} {'':8} {'objects':>7} {'A':>9} {'B':>9} {'A - B':>9}   95 % interval"
    lines = [head, "-" * len(head)]
    for metric, rows in results.items():
        for place, row in rows.items():
            interval = "one object" if row.low is None else f"[{row.low:+.4f}, {row.high:+.4f}]"
            lines.append(
                f"{metric:20} {place:8} {row.objects:7d} {row.a:9.4f} {row.b:9.4f} {row.difference:+9.4f}   "
                f"{interval}{' *' if row.clear else ''}"
            )
    return "\n".join(lines)


def check_alike(a: Evaluations, b: Evaluations) -> None:
    """Refuse results that were not measured on the same objects and views in the same way."""
    first, expected = a.folders[0], a.facts[0]
    for folder, facts in zip((*a.folders, *b.folders), (*a.facts, *b.facts), strict=True):
        for key in SAME:
            if facts[key] != expected[key]:
                raise UserError(
                    f"{first} and {folder}: were measured with {key} {expected[key]} and {facts[key]}; evaluate both "
                    f"in the same way"
                )
    if set(a.keys) != set(b.keys):
        only_a, only_b = (sorted(set(x.keys) - set(y.keys)) for x, y in ((a, b), (b, a)))
        one = "/".join(map(str, (only_a or only_b)[0]))
        raise UserError(
            f"{a.name} and {b.name}: {len(only_a)} object-views are only in the first and {len(only_b)} only in the "
            f"second, such as {one}; evaluate both with the same data, subset and views"
        )


def check_seeds(side: Evaluations) -> None:
    """Refuse results that are of several models, or twice of one training: they are no seeds of one model."""
    first = model_settings(side.facts[0])
    for folder, facts in zip(side.folders, side.facts, strict=True):
        settings = model_settings(facts)
        other = [key for key in first | settings if first.get(key) != settings.get(key)]
        if other:
            raise UserError(
                f"{side.name}: {side.folders[0]} and {folder} are no seeds of one model, they differ in {other[0]} "
                f"({first.get(other[0])} and {settings.get(other[0])}); compare them one by one"
            )
    of_seed: dict[int, Path] = {}
    for folder, seed in zip(side.folders, side.seeds, strict=True):
        if seed is not None and of_seed.setdefault(seed, folder) != folder:
            raise UserError(
                f"{side.name}: {of_seed[seed]} and {folder} are both of the training with seed {seed}; give one of them"
            )


def _notes(a: Evaluations, b: Evaluations) -> list[str]:
    found = {key: list(dict.fromkeys(str(facts.get(key)) for facts in (*a.facts, *b.facts))) for key in NOTED}
    return [f"{key} differs: {' | '.join(values)}" for key, values in found.items() if len(values) > 1]


def _record(a: Evaluations, b: Evaluations, results: Results, draws: int, seed: int) -> dict[str, Any]:
    return environment() | {
        "a": [str(folder) for folder in a.folders],
        "b": [str(folder) for folder in b.folders],
        "draws": draws,
        "seed": seed,
        "level": LEVEL,
        "notes": _notes(a, b),
        "results": {
            metric: {place: vars(row) | {"clear": row.clear} for place, row in rows.items()}
            for metric, rows in results.items()
        },
    }


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m stereo_occ.compare", description=__doc__)
    parser.add_argument("a", help="folder of an evaluation, or a quoted pattern of one folder per seed")
    parser.add_argument("b", help="what it is compared with")
    parser.add_argument("--metrics", nargs="+", metavar="METRIC", help="default: all that both have")
    parser.add_argument("--draws", type=int, default=10_000, help="of the bootstrap (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the bootstrap (default %(default)s)")
    parser.add_argument("--output", type=Path, default=Path("outputs/compare"), help="default %(default)s")
    parsed, rest = parser.parse_known_args(arguments)
    if rest:
        parser.error(
            f"unexpected {' '.join(rest)}; quote a pattern of several folders: 'outputs/evaluate/stereo_*'"
        )
    return parsed


def _check(asked: argparse.Namespace) -> None:
    if not 1 <= asked.draws <= MOST_DRAWS:
        raise UserError(f"--draws {asked.draws}: must be from 1 to {MOST_DRAWS}")
    if asked.seed < 0:
        raise UserError(f"--seed {asked.seed}: must not be negative")
    for name in (RECORD, PLOT):
        if (asked.output / name).is_dir():
            raise UserError(
                f"--output {asked.output}: {name} in it is a folder; give another folder, or move that one"
            )


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare, print the table and write the files."""
    asked = _arguments(arguments)
    try:
        _check(asked)
        a, b = (read_evaluations(name, find_evaluations(name)) for name in (asked.a, asked.b))
        for side in (a, b):
            check_seeds(side)
        results = compare(a, b, asked.metrics, asked.draws, asked.seed)
        forest_plot(
            results, a.name, b.name, asked.output / PLOT
        )  # the larger one first, while nothing is there
        write_json(asked.output / RECORD, _record(a, b, results, asked.draws, asked.seed))
        with watched_output(_refuse):
            for line in _report(a, b, results, asked.output).split("\n"):
                sys.stdout.write(f"{printable(line)}\n")
    except Exception as error:
        _refuse(one_line(error))


def _report(a: Evaluations, b: Evaluations, results: Results, output: Path) -> str:
    seeds = f"A: {a.name} ({len(a.folders)} seeds)\nB: {b.name} ({len(b.folders)} seeds)"
    notes = "".join(f"note: {note}\n" for note in _notes(a, b))
    return f"{seeds}\n{notes}\n{table(results)}\n\nalso in {output}"


def _refuse(problem: str) -> NoReturn:
    sys.stderr.write(f"stereo_occ: {printable(problem)}\n")
    raise SystemExit(2)


if __name__ == "__main__":
    main()
