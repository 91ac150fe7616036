"""All meshes of a data set, read and repaired in processes of their own, so that none can stop the others."""

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pebble import ProcessExpired, ProcessPool
from tqdm import tqdm

from stereo_occ.cores import available_cores
from stereo_occ.data.processes import limit_memory, start_worker
from stereo_occ.errors import UserError
from stereo_occ.shapes.inspection import Inspection
from stereo_occ.shapes.layouts import MeshFile
from stereo_occ.shapes.mesh_cache import DAMAGED, MeshCache, load
from stereo_occ.shapes.shape import Shape

#: Solids are copies whose likenesses differ by less than this share: single precision and text files differ by 1e-6.
ALIKE = 1e-4


@dataclass(frozen=True, eq=False)
class MeshRecord:
    """A file of a data set and what became of it.

    Attributes:
        outcome: without mesh and colours, which :meth:`load` reads.
        entry: in the cache; None if inspecting the file failed.
    """

    file: MeshFile
    outcome: Inspection
    entry: Path | None

    def load(self) -> Inspection:
        """The outcome with mesh and colours.

        Raises:
            UserError: the cache is damaged.
        """
        if self.entry is None:
            return self.outcome
        try:
            return load(self.entry)
        except DAMAGED as error:
            raise UserError(f"{self.entry}: cannot be read ({error}); delete it and try again") from error

    def shape(self) -> Shape:
        """The object, if the file was not rejected."""
        return self.load().shape(self.file)


def inspect_files(
    files: Sequence[MeshFile],
    cache: MeshCache,
    workers: int,
    time_limit: float,
    memory_limit: float,
    progress: bool,
) -> list[MeshRecord]:
    """Inspect files that are not in the cache, each within limits; a record for each file.

    A file whose process hangs, crashes, is killed or wants too much memory is rejected with that reason, and tried
    again the next time.

    Args:
        workers: processes; 0: one per core.
        time_limit: seconds for one file.
        memory_limit: GB for one file.

    Raises:
        UserError: the cache cannot be written.
    """
    entries = {file.path: cache.find(file.path) for file in files}
    missing = [path for path, entry in entries.items() if entry is None]
    failures: dict[Path, str] = {}
    if missing:
        count = min(len(missing), workers or available_cores())
        # Spawned: a process forked from one with threads or OpenGL may hang.
        context = multiprocessing.get_context("spawn")
        with (
            tqdm(total=len(missing), desc="reading meshes", unit="mesh", disable=not progress) as bar,
            ProcessPool(count, initializer=_start, initargs=[memory_limit], context=context) as pool,
        ):
            jobs: dict[Future[Path], Path] = {
                pool.schedule(cache.make, args=(path,), timeout=time_limit): path for path in missing
            }
            try:
                for job in as_completed(jobs):
                    entries[jobs[job]], failures[jobs[job]] = _result(job, time_limit, memory_limit)
                    bar.update()
            except BaseException:
                pool.stop()
                raise
    return [_record(file, entries[file.path], failures.get(file.path, "")) for file in files]


def without_copies(records: Sequence[MeshRecord]) -> Iterator[MeshRecord]:
    """The records, those rejected that hold the same solid as one before them, in whatever colours, size or place.

    A solid must not be in two subsets.
    """
    kept: list[MeshFile] = []
    known_K4 = np.zeros((0, 4))
    for record in records:
        if record.outcome.reason:
            yield record
            continue
        likeness_4 = np.array(record.outcome.likeness)
        alike = np.flatnonzero(np.isclose(known_K4, likeness_4, rtol=ALIKE, atol=0).all(axis=1))
        if len(alike):
            original = kept[alike[0]]
            reason = f"is a copy of {original.category}/{original.object_id}"
            yield replace(record, outcome=replace(record.outcome, reason=reason))
            continue
        kept.append(record.file)
        known_K4 = np.concatenate([known_K4, likeness_4[None]])
        yield record


def _start(memory_limit: float) -> None:
    """Begin a process; what it imports, this module's own imports among them, is there already."""
    start_worker()
    limit_memory(memory_limit)


def _record(file: MeshFile, entry: Path | None, failure: str) -> MeshRecord:
    if entry is None:
        return MeshRecord(file, Inspection(None, reason=failure), None)
    return MeshRecord(file, load(entry, header_only=True), entry)


def _result(job: Future[Path], time_limit: float, memory_limit: float) -> tuple[Path | None, str]:
    """The entry of a finished job, or why there is none."""
    try:
        return job.result(), ""
    except UserError:
        raise
    except TimeoutError:
        return None, f"took longer than data.time_limit={time_limit:g} seconds"
    except MemoryError:
        return None, f"needs more memory than data.memory_limit={memory_limit:g} GB"
    except ProcessExpired as error:
        return None, f"the process that read it ended with code {error.exitcode}, perhaps for want of memory"
    except Exception as error:  # whatever a mesh does to the libraries, the others are to be read
        return None, f"failed: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
