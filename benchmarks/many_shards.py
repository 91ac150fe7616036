"""Train from more shards than a process may have files open, and what a small limit on open shards costs.

Copies, not links: to HDF5 all links of a file are one open file.
"""

import argparse
import json
import random
import resource
import tempfile
import time
from pathlib import Path
from statistics import median

from stereo_occ.config import QueriesConfig
from stereo_occ.data import open_shards
from stereo_occ.data.dataset import ShuffledBatches, TrainingPairs
from stereo_occ.data.shard import Shard
from stereo_occ.provenance import environment

BATCH = 32


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def pairs_of(paths: list[Path]) -> TrainingPairs:
    """Each with one view."""
    return TrainingPairs([Shard(path) for path in paths], [0], QueriesConfig(1.0, 0.0, 0.0), 32, seed=0)


def read(pairs: TrainingPairs, steps: int) -> tuple[float, int]:
    """Pairs per second over ``steps`` batches, and the most files that were open."""
    most, start = 0, time.perf_counter()
    for step, batch in enumerate(ShuffledBatches(len(pairs), BATCH, steps, seed=0)):
        pairs.__getitems__(batch)
        if step % 16 == 0:
            most = max(most, open_files())
    return steps * BATCH / (time.perf_counter() - start), most


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shard", type=Path, required=True, help="that is copied")
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--files", type=int, default=256, help="as ulimit -n")
    parser.add_argument("--compared", type=int, default=640, help="shards for the comparison of limits")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--output", type=Path, help="JSON file for the table")
    options = parser.parse_args()
    content = options.shard.read_bytes()
    with tempfile.TemporaryDirectory() as root:
        paths = [Path(root) / f"{index}.h5" for index in range(options.count)]
        for path in paths:
            path.write_bytes(content)
        hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (options.files, hard))
        speed, most = read(pairs_of(paths), options.count // BATCH)
        print(f"{options.count} shards, {options.files} files: {most} open at most, {speed:.0f} pairs/s")
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
        compared = pairs_of(paths[: options.compared])
        speeds: dict[int, list[float]] = {128: [], open_shards.MOST_OPEN: []}
        for _ in range(options.rounds):
            for limit in random.sample(list(speeds), len(speeds)):  # interleaved, in any order
                open_shards.MOST_OPEN = limit
                read(compared, 2 * options.compared // BATCH)  # until as many as may be are open
                speeds[limit].append(read(compared, 2 * options.compared // BATCH)[0])
    medians = {limit: round(median(values)) for limit, values in speeds.items()}
    print(f"{options.compared} shards, at most so many open: pairs/s {medians}")
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        facts = {"bytes": len(content), "count": options.count, "files": options.files, "most open": most}
        facts |= {"pairs per second": round(speed), "compared": options.compared, "by limit": medians}
        options.output.write_text(json.dumps(environment() | facts, indent=2) + "\n")


if __name__ == "__main__":
    main()
