"""What every process started for the data has in common."""

import multiprocessing
import os
import threading


def start_worker() -> None:
    """One thread for the software rasteriser and for NumPy, since processes share the cores; end with the parent."""
    os.environ |= {"LP_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
