"""How many threads and processes a machine can be asked for: with far too many a program ends without a word."""

import os
from collections.abc import Iterator

#: For each core; more than one leaves room for settings that were made for a larger machine.
PER_CORE = 16


def available_cores() -> int:
    """Those that this process may use: fewer than the machine has under Slurm, taskset or in a container."""
    if hasattr(os, "sched_getaffinity"):  # of Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def beyond_cores(key: str, count: int) -> Iterator[str]:
    """The problem of a setting that asks for more threads or processes than this machine can take."""
    cores = os.cpu_count() or 1
    if count > PER_CORE * cores:
        yield (
            f"{key}={count}: must be at most {PER_CORE * cores}, {PER_CORE} for each core; this machine has {cores}"
        )
