"""Command lines run in this process, which saves the seconds that a process takes to start."""

import logging
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest


@dataclass(frozen=True)
class Outcome:
    """What a command did: its exit code, its output, and the files that are new, changed or gone."""

    code: int
    out: str
    err: str
    touched: list[str]

    @property
    def lines(self) -> list[str]:
        """What it said on standard error."""
        return self.err.splitlines()


class EntryPoints:
    """Runs ``python -m stereo_occ.PROGRAM ARGUMENTS`` in a folder."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
        self.folder, self.monkeypatch, self.capsys = folder, monkeypatch, capsys

    def __call__(self, program: str, arguments: Sequence[str]) -> Outcome:
        module = import_module(
            f"stereo_occ.{program}.__main__" if program in ("render", "report") else f"stereo_occ.{program}"
        )
        before = files(self.folder)
        self.monkeypatch.chdir(self.folder)
        self.monkeypatch.setattr(sys, "argv", [program, *arguments])
        self.capsys.readouterr()
        code = 0
        with _logging_as_it_was():
            try:
                module.main()
            except SystemExit as stop:
                code = int(stop.code or 0)
        said = self.capsys.readouterr()
        after = files(self.folder)
        touched = [name for name in sorted({*before, *after}) if before.get(name) != after.get(name)]
        return Outcome(code, said.out, said.err, touched)


def files(folder: Path) -> Mapping[str, tuple[int, int]]:
    """Every file and folder with the time of its last change and its size; of folders neither."""
    return {
        str(path.relative_to(folder)): (stat.st_mtime_ns, stat.st_size) if path.is_file() else (0, 0)
        for path in folder.rglob("*")
        for stat in [path.lstat()]
    }


@contextmanager
def _logging_as_it_was() -> Iterator[None]:
    """Hydra gives the root logger handlers that write to this test's streams."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    try:
        yield
    finally:
        for handler in root.handlers:
            if handler not in handlers:
                handler.close()
        root.handlers[:] = handlers
        root.setLevel(level)
