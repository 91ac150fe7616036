"""What every process started for the data has in common."""

import multiprocessing
import os
import resource
import threading
from math import isfinite
from pathlib import Path


def start_worker() -> None:
    """One thread for the software rasteriser and for NumPy, since processes share the cores; end with the parent."""
    os.environ |= {"LP_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    threading.Thread(target=_end_with_parent, daemon=True).start()


def limit_memory(gigabytes: float) -> None:
    """Let this process have no more memory for data than this beside what it has already: more is an error.

    The limit is Linux's on data; it has no effect on macOS.
    """
    if isfinite(gigabytes):
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        limit = _data_in_use() + int(gigabytes * 1e9)
        resource.setrlimit(resource.RLIMIT_DATA, (limit if hard < 0 else min(limit, hard), hard))


def _data_in_use() -> int:
    """Bytes of this process that the limit counts; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:")), 0)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
