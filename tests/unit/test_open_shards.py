"""More shards than can be open at once."""

import errno
import gc
import resource
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import h5py
import numpy as np
import pytest
from samples import small_shard

from stereo_occ.data import open_shards
from stereo_occ.data.open_shards import forget, most_open, use
from stereo_occ.data.shard import Shard
from stereo_occ.errors import UserError


@pytest.fixture(autouse=True)
def _none_open(monkeypatch):
    monkeypatch.setattr(open_shards, "_open", type(open_shards._open)())
    monkeypatch.setattr(open_shards, "MOST_OPEN", 3)


class Door:
    def __init__(self):
        self.is_open = True

    def close(self):
        self.is_open = False


def test_the_one_not_used_for_longest_is_closed():
    doors = [Door() for _ in range(4)]
    for door in (*doors[:3], doors[0]):
        use(door)
    assert all(door.is_open for door in doors)
    use(doors[3])
    assert [door.is_open for door in doors] == [True, False, True, True]


def test_what_was_closed_or_is_gone_leaves_room():
    doors = [Door() for _ in range(5)]
    for door in doors[:3]:
        use(door)
    forget(doors[0])
    use(doors[3])
    assert all(door.is_open for door in doors[:4])
    del doors[1], door
    gc.collect()
    use(doors[-1])
    assert all(door.is_open for door in doors)


def test_fewer_where_the_system_allows_fewer_files(monkeypatch):
    monkeypatch.setattr(open_shards, "MOST_OPEN", 768)
    for files, expected in ((resource.RLIM_INFINITY, 768), (1024, 768), (256, 128), (32, 8)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, files=files: (files, files))
        assert most_open() == expected


def test_a_closed_shard_opens_again_with_the_same_content(tmp_path):
    shards = [Shard(small_shard(tmp_path, object_id=f"cup_{i}", seed=i)) for i in range(5)]
    first = [(s.object_id, s.rgb(0), s.pose(0).rig_from_object, s.pool("box").grid_N3) for s in shards]
    assert [len(vars(shard)) > 1 for shard in shards] == [False, False, True, True, True]
    for shard, expected in zip(shards, first, strict=True):
        again = (shard.object_id, shard.rgb(0), shard.pose(0).rig_from_object, shard.pool("box").grid_N3)
        for one, other in zip(again, expected, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_shard_whose_name_alone_was_read_counts(tmp_path):
    shards = [Shard(small_shard(tmp_path, object_id=f"cup_{i}", seed=i)) for i in range(5)]
    assert [shard.object_id for shard in shards] == [f"cup_{i}" for i in range(5)]
    assert ["_file" in vars(shard) for shard in shards] == [False, False, True, True, True]


def test_what_the_system_refuses_is_no_damage(tmp_path, monkeypatch):
    path = small_shard(tmp_path)
    full = OSError(errno.EMFILE, "Unable to open file (errno = 24, error message = 'Too many open files')")
    monkeypatch.setattr(h5py, "File", Mock(side_effect=full))
    with pytest.raises(UserError, match=r"\.h5: Too many open files; raise the limit on open files"):
        Shard(path).rgb(0)


MANY = """
import resource, shutil, sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from samples import small_shard
from stereo_occ.config import QueriesConfig
from stereo_occ.data.dataset import ShuffledBatches, TrainingPairs
from stereo_occ.data.shard import Shard

source = small_shard(Path({folder!r}), side=4)
paths = [source.with_name(f"copy_{{i}}.h5") for i in range(10_000)]
pairs = TrainingPairs([Shard(path) for path in paths], [0, 1], QueriesConfig(1.0, 0.0, 0.0), 8, seed=0)
batches = list(ShuffledBatches(len(pairs), 16, 25, seed=0))
for draw in (draw for batch in batches for draw in batch):  # copies: HDF5 opens the links of a file once
    shutil.copy(source, pairs.locate(draw.item)[0].path)
hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (256, hard))
for batch in batches:
    assert len(pairs.__getitems__(batch)) == 16
print("read", 128 <= len(list(Path("/proc/self/fd").iterdir())) < 256)
"""


def test_ten_thousand_shards_where_256_files_may_be_open(tmp_path):
    source = MANY.format(tests=str(Path(__file__).parents[1]), folder=str(tmp_path))
    run = subprocess.run(
        [sys.executable, "-B", "-c", source], capture_output=True, text=True, timeout=300, check=False
    )
    assert (run.returncode, run.stdout) == (0, "read True\n"), run.stderr[-2000:]
