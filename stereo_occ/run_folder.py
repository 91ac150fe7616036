"""Run folders of commands that did nothing."""

import shutil
from contextlib import suppress
from pathlib import Path


def remove_traces(folder: Path, job: str) -> None:
    """Remove what Hydra has put into a run folder that holds nothing else, and the folders that are empty then.

    Args:
        folder: of the run.
        job: Hydra's name of it, after which its log is called.
    """
    log = folder / f"{job}.log"
    here = Path.cwd()
    if folder.resolve() == here or not folder.is_dir() or set(folder.iterdir()) - {folder / ".hydra", log}:
        return
    if log.exists() and log.stat().st_size:
        return
    shutil.rmtree(folder / ".hydra", ignore_errors=True)
    log.unlink(missing_ok=True)
    with suppress(OSError):  # not empty
        for empty in (folder, *folder.parents):
            if empty.resolve() == here:
                break
            empty.rmdir()
