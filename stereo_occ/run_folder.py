"""Whose a run folder is, what it holds of its command, and what is removed where a command did nothing."""

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stereo_occ.errors import UserError
from stereo_occ.group import is_first

#: The overrides of a training's command line.
OVERRIDES = "overrides.yaml"


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Let no other process run in a folder that is no working directory, as long as the context lasts.

    Of a group of processes the first claims it for all. Where the system knows no locks of folders, as on some network
    drives, nobody is kept from it.

    Raises:
        UserError: another process has claimed the folder.
    """
    if folder.resolve() == Path.cwd() or not folder.is_dir() or not is_first():
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # no locks here
            _lock(descriptor, folder)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, folder: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise UserError(
            f"hydra.run.dir={folder}: another process is running in this folder; wait for it, or give another folder"
        ) from error


def remove_traces(folder: Path) -> None:
    """Remove a run folder that holds nothing but Hydra's notes, and those above it that are empty then."""
    here = Path.cwd()
    if folder.resolve() == here or not folder.is_dir() or set(folder.iterdir()) - {folder / ".hydra"}:
        return
    shutil.rmtree(folder / ".hydra", ignore_errors=True)
    with suppress(OSError):  # not empty
        for empty in (folder, *folder.parents):
            if empty.resolve() == here:
                break
            empty.rmdir()
