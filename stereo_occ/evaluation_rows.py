"""Evaluations read back from their folders."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_occ.errors import UserError
from stereo_occ.evaluation_form import IDENTITY, wrong_value
from stereo_occ.metrics.summary import METRICS, ROW_KEYS
from stereo_occ.provenance import SCHEMA

#: What every object-view has a value of, so that no table is without it.
ALWAYS = "iou"

#: Category, object, view.
Key = tuple[str, str, int]


@dataclass(frozen=True, eq=False)
class Evaluations:
    """Evaluations of one model from several training seeds, on the same object-views.

    Attributes:
        name: as asked for.
        keys: the V object-views, in order.
        values: of each metric that applies to any of them ``(S, V)``; NaN where it does not.
        facts: of each one's ``metrics.json``.
    """

    name: str
    folders: list[Path]
    keys: list[Key]
    values: dict[str, NDArray[np.float64]]
    facts: list[dict[str, Any]]

    @property
    def categories(self) -> set[str]:
        """Of the objects."""
        return {category for category, _, _ in self.keys}

    @property
    def seeds(self) -> list[int | None]:
        """Of each training; None where the file does not say."""
        return [(facts.get("trained") or {}).get("config", {}).get("seed") for facts in self.facts]


def find_evaluations(pattern: str) -> list[Path]:
    """The folder of that name, or those that match the pattern.

    Raises:
        UserError: there is none.
    """
    found = [pattern] if Path(pattern).is_dir() else sorted(glob(pattern))  # noqa: PTH207 (it may be absolute)
    folders = [Path(path) for path in found if Path(path).is_dir()]
    if not folders:
        raise UserError(f"{pattern}: no such folder; give the folder of an evaluation")
    return folders


def read_evaluations(name: str, folders: Sequence[Path]) -> Evaluations:
    """The evaluations in these folders as one model's.

    Raises:
        UserError: one is none or of another version, or they are not of the same object-views.
    """
    facts = [read_facts(folder) for folder in folders]
    tables = [_table(folder) for folder in folders]
    keys = sorted(tables[0])
    for folder, rows in zip(folders, tables, strict=True):
        if sorted(rows) != keys:
            raise UserError(
                f"{name}: {folder} has other object-views than {folders[0]}; compare them one by one"
            )
    values = {
        metric: np.array([[rows[key].get(metric, np.nan) for key in keys] for rows in tables])
        for metric in METRICS
    }
    return Evaluations(
        name,
        list(folders),
        keys,
        {metric: of_metric for metric, of_metric in values.items() if np.isfinite(of_metric).any()},
        facts,
    )


def read_facts(folder: Path) -> dict[str, Any]:
    """What ``metrics.json`` of an evaluation says.

    Raises:
        UserError: there is none, or it is damaged or of another version.
    """
    try:
        facts: Any = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(
            f"{folder}: has no readable metrics.json; give the folder of an evaluation"
        ) from error
    if not isinstance(facts, dict) or facts.get("schema") != SCHEMA or "subset" not in facts:
        raise UserError(
            f"{folder}/metrics.json: is no evaluation of form {SCHEMA}; evaluate the checkpoint again"
        )
    wrong = wrong_value(facts, IDENTITY)
    if wrong:
        raise UserError(f"{folder}/metrics.json: is damaged, {wrong}; evaluate the checkpoint again")
    return facts


def _table(folder: Path) -> dict[Key, dict[str, float]]:
    path = folder / "per_object.csv"
    try:
        text = path.read_bytes().decode()
    except (OSError, ValueError) as error:
        raise UserError(f"{folder}: has no readable per_object.csv; evaluate the checkpoint again") from error
    table: dict[Key, dict[str, float]] = {}
    try:
        reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
        missing = [name for name in (*ROW_KEYS, ALWAYS) if name not in (reader.fieldnames or ())]
        if missing and text:
            raise UserError(f"{path}: has no column {missing[0]}; evaluate the checkpoint again")
        for row in reader:
            _add_row(table, row)
    except (ValueError, csv.Error) as error:
        if text.endswith("\n"):
            raise UserError(
                f"{path}: is damaged in row {len(table) + 1}, {error!s:.90}; evaluate the checkpoint again"
            ) from error
    if not table or not text.endswith("\n"):
        raise UserError(f"{path}: is cut off after {len(table)} rows; evaluate the checkpoint again")
    return table


def _add_row(table: dict[Key, dict[str, float]], row: dict[str, str]) -> None:
    """Add a row as ``csv.DictReader`` gives it.

    Raises:
        ValueError: it has more or fewer cells than the head, a word for a number, no IoU, or is there already.
    """
    if None in row or None in row.values():
        raise ValueError("which has not as many cells as the head")
    key = (row["category"], row["object_id"], int(row["view"]))
    if key in table:
        raise ValueError(f"{'/'.join(map(str, key))!r} is there twice")
    values = {name: float(cell) for name, cell in row.items() if name in METRICS and cell}
    if not np.isfinite(values.get(ALWAYS, np.nan)):
        raise ValueError(f"{ALWAYS} is {row[ALWAYS]!r}")
    table[key] = values
