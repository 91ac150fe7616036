"""Files that are there whole or not at all."""

import json
import os
import socket
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import Any, BinaryIO

from stereo_occ.errors import UserError


def partial_path(path: Path, host: str, process: int) -> Path:
    """Where a process of a machine writes a file before it gets its name."""
    return path.with_name(f".{path.name}.{host}.{process}.part")


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write that gets its name when it is complete and on the disk; if that fails, ``path`` is as before.

    Raises:
        OSError: it cannot be written; names ``path``.
    """
    host = socket.gethostname()
    partial = partial_path(path, host, os.getpid())
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        remove_partial(path.parent.glob(f"{escape(f'.{path.name}.{host}.')}*.part"))
        with partial.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def in_the_way(
    output: str, files: Sequence[Path], inputs: Iterable[tuple[str, Path]] = (), kind: str = ""
) -> list[str]:
    """Why ``output=`` must not be written: a folder has that name, or a file that would be lost.

    Args:
        output: as the user gave it.
        files: that come of it, the main one first.
        inputs: files that are read, each with its key.
        kind: what the main file is, where others that are there without it are somebody's own; else these are replaced.
    """
    main = files[0]
    try:
        for path in files:
            beside = "" if str(path) == output else f"would write {path}, which "
            if path.is_dir():
                return [f"output={output}: {beside}is a folder; give another file"]
            if not path.exists():
                continue
            for key, read in inputs:
                if read.exists() and path.samefile(read):
                    return [f"output={output}: would write over {key}={read}; give another file"]
            if kind and not main.exists():
                return [f"output={output}: would write over {path}, which is of no {kind}; give another file"]
    except OSError:  # no way to look at it, nor to write it: whoever writes says so
        return []
    return []


def remove_partial(files: Iterable[Path]) -> None:
    """Of partial files, remove those that are :func:`left_behind`."""
    for partial in filter(left_behind, files):
        partial.unlink(missing_ok=True)


def left_behind(partial: Path) -> bool:
    """Whether a process of this machine that is no more has begun this partial file."""
    _, process, _ = partial.name.rsplit(".", 2)
    return f".{socket.gethostname()}.{process}." in partial.name and not _is_alive(int(process))


def _is_alive(process: int) -> bool:
    """Whether it runs; one that was killed may stay in the table of processes for seconds, as a zombie."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        pass
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:  # a system without /proc
        return True
    return state != "Z"


def write_whole(path: Path, data: bytes) -> None:
    """Write an output that the user asked for, whole or not at all.

    Raises:
        UserError: it cannot be written.
    """
    try:
        with whole_file(path) as file:
            file.write(data)
    except OSError as error:
        raise UserError(f"output={path}: cannot be written ({error.strerror or error})") from error


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file whole or not at all.

    Raises:
        ValueError: a number is NaN or infinite, which JSON does not know.
    """
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    with whole_file(path) as file:
        file.write(text.encode())
