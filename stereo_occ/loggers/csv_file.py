"""A CSV file: a column per metric, a row whenever some are logged."""

import csv
from collections.abc import Iterable, Mapping
from io import StringIO
from pathlib import Path
from typing import ClassVar, TextIO

import yaml

from stereo_occ.loggers.board import Board, Scalar
from stereo_occ.writing import whole_file

STEP = "step"


class CsvFile(Board):
    """``curves.csv`` and ``settings.yaml`` in ``folder``; no pictures or meshes.

    Args:
        step: that the run continues from; rows of an earlier part after it are dropped, the others stay.
    """

    shows: ClassVar[bool] = False

    def __init__(self, folder: Path, step: int) -> None:
        super().__init__()
        self.path = folder / "curves.csv"
        self.settings_path = folder / "settings.yaml"
        self.names: list[str] = []
        self.rows: list[dict[str, str]] = []
        if step and self.path.exists():
            with self.path.open(newline="", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            self.rows = [row for row in rows if row[STEP] and int(row[STEP]) <= step]
            self.names = [name for name in (rows[0] if rows else ()) if name != STEP]
        self._rewrite()

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        row = {STEP: str(step)} | {name: repr(value) for name, value in values.items()}
        self.rows.append(row)
        if new := set(values) - set(self.names):
            self.names = sorted({*self.names, *new})
            self._rewrite()
        else:
            with self.path.open("a", newline="", encoding="utf-8") as file:
                self._write(file, [row])

    def settings(self, values: Mapping[str, Scalar]) -> None:
        with whole_file(self.settings_path) as file:
            file.write(yaml.safe_dump(dict(values), sort_keys=False, allow_unicode=True).encode())

    def _rewrite(self) -> None:
        """With all columns that there are by now."""
        text = StringIO(newline="")
        self._write(text, [{name: name for name in (STEP, *self.names)}, *self.rows])
        with whole_file(self.path) as file:
            file.write(text.getvalue().encode())

    def _write(self, file: TextIO, rows: Iterable[Mapping[str, str]]) -> None:
        csv.DictWriter(file, (STEP, *self.names), restval="", lineterminator="\n").writerows(rows)
