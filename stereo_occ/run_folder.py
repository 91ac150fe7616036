"""What a run folder holds of its command, and what is removed where a command did nothing."""

import shutil
from contextlib import suppress
from pathlib import Path

#: The overrides of a training's command line.
OVERRIDES = "overrides.yaml"


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
