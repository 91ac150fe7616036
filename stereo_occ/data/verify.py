"""Are the shards on disk what was written?"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from stereo_occ.data.shard import Shard, checksum_path
from stereo_occ.errors import UserError


@dataclass(frozen=True)
class Verification:
    """What became of shards: ``damaged`` with a line on each, ``missing``, and ``unchecked`` have no checksum of the
    whole file, so that only what HDF5 protects was checked."""

    damaged: dict[Path, str]
    missing: list[Path]
    unchecked: list[Path]

    @property
    def well(self) -> bool:
        """Whether everything is there and nothing is damaged."""
        return not self.damaged and not self.missing


def verify(paths: Sequence[Path], progress: bool) -> Verification:
    """Compare shards with their checksums; read everything of those that have none."""
    result = Verification({}, [], [])
    for path in tqdm(paths, desc="verifying", unit="shard", disable=not progress):
        if not path.exists():
            result.missing.append(path)
        elif checksum_path(path).exists():
            if not _is_as_written(path):
                result.damaged[path] = "the file differs from its checksum"
        else:
            result.unchecked.append(path)
            try:
                with Shard(path) as shard:
                    shard.verify()
            except UserError as error:
                result.damaged[path] = str(error)
    return result


def _is_as_written(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return checksum_path(path).read_bytes() == f"{digest}  {path.name}\n".encode()
    except OSError:
        return False
