"""Watch a running process until it ends: resident memory and open files, and whether the memory grows (Linux).

    python -m stereo_occ.train model=stereo & python -m benchmarks.memory $! --output memory.csv

Growth is the slope of a straight line through what was seen after the first ten minutes; of shorter runs, in their
second half.
"""

import argparse
import csv
import time
from pathlib import Path

import numpy as np

COLUMNS = ("seconds", "resident_mb", "open_files")
SETTLED = 600  # seconds until everything that a training keeps is there


def sample(process: Path) -> tuple[float, int] | None:
    """Resident MB and open files, None once the process has ended."""
    try:
        status = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
        return int(status["VmRSS"].split()[0]) / 1024, len(list((process / "fd").iterdir()))
    except (OSError, KeyError):  # a process that ended has no VmRSS
        return None


def watch(pid: int, every: float, output: Path) -> None:
    """One row every so many seconds."""
    start = time.monotonic()
    with output.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        while (seen := sample(Path("/proc") / str(pid))) is not None:
            writer.writerow([round(time.monotonic() - start), f"{seen[0]:.1f}", seen[1]])
            file.flush()
            time.sleep(every)


def summary(path: Path) -> str:
    """What a file of :func:`watch` shows, in one line."""
    seconds_N, resident_N, files_N = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).T
    settled_N = seconds_N >= min(SETTLED, seconds_N[-1] / 2)
    slope = np.polyfit(seconds_N[settled_N], resident_N[settled_N], 1)[0] * 3600
    return (
        f"{seconds_N[-1] / 60:.0f} minutes, {len(seconds_N)} looks: {resident_N[settled_N].min():.0f} to "
        f"{resident_N[settled_N].max():.0f} MB, growing {slope:+.1f} MB an hour, {files_N.max():.0f} files open at most"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pid", type=int)
    parser.add_argument("--every", type=float, default=20, help="seconds")
    parser.add_argument("--output", type=Path, default=Path("memory.csv"))
    options = parser.parse_args()
    watch(options.pid, options.every, options.output)
    if len(options.output.read_text().splitlines()) < 5:
        parser.error(f"{options.pid}: no such process, not yours, or it ended too soon")
    print(summary(options.output))


if __name__ == "__main__":
    main()
