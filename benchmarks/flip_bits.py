"""Flip bits in shards, weights and checkpoints and cut them short: is every damage reported, or without effect?

Each damaged file is read as commands read it, and all that is read is compared with the undamaged one's. Shards are
damaged twice: read (by what trains and evaluates) and verified (by render verify=true).
"""

import argparse
import hashlib
import json
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stereo_occ.checkpoint import read_checkpoint
from stereo_occ.data.shard import Shard, checksum_path
from stereo_occ.data.verify import verify
from stereo_occ.errors import UserError
from stereo_occ.provenance import environment

Read = Callable[[Path], Any]


def shard_content(path: Path) -> list[Any]:
    """Everything that a shard holds."""
    with Shard(path) as shard:
        arrays: list[Any] = [shard.mesh.vertices, shard.mesh.faces]
        for view in range(len(shard)):
            arrays += [shard.rgb(view), shard.mask(view), shard.depth(view), shard.pose(view).rig_from_object]
            arrays += shard.cameras(view)
        for name in ("box", "surface"):
            pool = shard.pool(name)
            arrays += [pool.grid_N3, pool.low_3, pool.extent_3, pool.part_N]
        return [
            *(np.ascontiguousarray(a).tobytes() for a in arrays),
            shard.category,
            shard.object_id,
            shard.facts,
        ]


def shard_verified(path: Path) -> None:
    """As ``render verify=true`` does."""
    if damaged := verify([path], progress=False).damaged:
        raise UserError(f"damaged {path}: {damaged[path]}; delete the damaged files and render again")


def checkpoint_content(asked: Path, _: Path) -> Any:
    """Everything that a checkpoint or exported weights hold."""
    return read_checkpoint(asked)


def same(a: Any, b: Any) -> bool:
    """Whether nested plain values and tensors are equal to the bit."""
    if isinstance(a, torch.Tensor):
        return (
            isinstance(b, torch.Tensor) and a.dtype == b.dtype and a.numpy().tobytes() == b.numpy().tobytes()
        )
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and bool(a == b)


def damages(whole: bytes, flips: int, cuts: int, rng: random.Random) -> Iterator[tuple[str, bytes]]:
    for _ in range(flips):
        damaged, bit = bytearray(whole), rng.randrange(8 * len(whole))
        damaged[bit // 8] ^= 1 << (bit % 8)
        yield "flips", bytes(damaged)
    for _ in range(cuts):
        yield "cuts", whole[: rng.randrange(len(whole))]


def row(path: Path, read: Read, flips: int, cuts: int, rng: random.Random) -> dict[str, Any]:
    """Counts of what became of the damages of one file."""
    whole, expected = path.read_bytes(), read(path)
    counts: Counter[str] = Counter()
    for kind, damaged in damages(whole, flips, cuts, rng):
        path.write_bytes(damaged)
        try:
            counts[f"{kind} without effect" if same(read(path), expected) else f"{kind} SILENT"] += 1
        except UserError as error:
            named = path.name in str(error) and "\n" not in str(error)
            counts[f"{kind} reported" if named else f"{kind} UNNAMED"] += 1
    path.write_bytes(whole)
    return {"bytes": len(whole), **counts}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shard", type=Path, required=True)
    parser.add_argument("--checkpoint", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True, help=".safetensors with its .json beside it")
    parser.add_argument("--flips", type=int, default=200, help="of each file")
    parser.add_argument("--cuts", type=int, default=50, help="of each file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="JSON file for the table")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as root:
        shard, checkpoint, weights = (
            Path(root) / path.name for path in (options.shard, options.checkpoint, options.weights)
        )
        for source, copy in (
            (options.shard, shard),
            (options.checkpoint, checkpoint),
            (options.weights, weights),
        ):
            copy.write_bytes(source.read_bytes())
        weights.with_suffix(".json").write_bytes(options.weights.with_suffix(".json").read_bytes())
        digest = hashlib.sha256(shard.read_bytes()).hexdigest()
        checksum_path(shard).write_text(f"{digest}  {shard.name}\n")  # as it was written
        of_weights = partial(checkpoint_content, weights)
        files: dict[str, tuple[Path, Read]] = {
            "shard, read": (shard, shard_content),
            "shard, verified": (shard, shard_verified),
            "checkpoint": (checkpoint, partial(checkpoint_content, checkpoint)),
            "weights: numbers": (weights, of_weights),
            "weights: description": (weights.with_suffix(".json"), of_weights),
        }
        rows = {
            name: row(path, read, options.flips, options.cuts, rng) for name, (path, read) in files.items()
        }
    for name, counts in rows.items():
        print(f"{name:22}", ", ".join(f"{value} {key}" for key, value in counts.items()))
    bad = [name for name, counts in rows.items() if any(key.split()[-1].isupper() for key in counts)]
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(
            json.dumps(environment() | {"seed": options.seed, "files": rows}, indent=2) + "\n"
        )
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
