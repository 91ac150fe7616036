"""Shards: what goes in comes out, or an error does."""

import multiprocessing
import os
import pickle
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples import pools_of, small_shard, solid, views_of

from stereo_occ.data import shard as shard_module
from stereo_occ.data.shard import VERSION, Shard, checksum_path
from stereo_occ.data.shard_writing import write_shard
from stereo_occ.errors import UserError
from stereo_occ.writing import left_behind, partial_path, remove_partial, write_whole


def contents(path):
    """Everything that a shard holds, as one comparable value."""
    with Shard(path) as shard:
        arrays = [shard.mesh.vertices, shard.mesh.faces, *shard.cameras(0)]
        for view in range(len(shard)):
            arrays += [shard.rgb(view), shard.mask(view), shard.depth(view), shard.pose(view).rig_from_object]
            arrays += shard.cameras(view)
        for name in ("box", "surface"):
            pool = shard.pool(name)
            arrays += [pool.grid_N3, pool.low_3, pool.extent_3, pool.part_N, pool.occupied_N]
        texts = (shard.category, shard.object_id, str(shard.facts), len(shard))
    return texts, [np.ascontiguousarray(array).tobytes() for array in arrays]


def test_units_are_kept_and_1_without(tmp_path):
    shape, views = solid("mug", "cup"), views_of(2)
    for name, unit_N in (("plain", None), ("measured", np.array([0.2, 0.35]))):
        write_shard(tmp_path / f"{name}.h5", shape, replace(views, unit=unit_N), pools_of(shape))
        with Shard(tmp_path / f"{name}.h5") as shard:
            assert [shard.unit(view) for view in range(2)] == ([1, 1] if unit_N is None else [0.2, 0.35])


@pytest.mark.parametrize("rows_at_once", [0, 128])
def test_everything_comes_back(tmp_path, monkeypatch, rows_at_once):
    monkeypatch.setattr(shard_module, "ROWS_AT_ONCE", rows_at_once)
    shape, views = solid("mug", "cup"), views_of(3)
    pools = pools_of(shape)
    path = tmp_path / "mug" / "cup.h5"
    write_shard(path, shape, views, pools)
    with Shard(path) as shard:
        assert (shard.category, shard.object_id, shard.facts) == ("mug", "cup", {"kind": "box"})
        assert len(shard) == 3
        np.testing.assert_allclose(shard.mesh.vertices, shape.mesh.vertices, atol=1e-7)
        np.testing.assert_array_equal(shard.mesh.faces, shape.mesh.faces)
        assert shard.mesh.is_volume
        for view in range(3):
            np.testing.assert_array_equal(shard.rgb(view), views.rgb[view])
            np.testing.assert_array_equal(shard.mask(view), views.mask[view])
            np.testing.assert_array_equal(shard.depth(view), views.depth[view])
            np.testing.assert_allclose(
                shard.pose(view).rig_from_object, views.rig_from_object[view], atol=1e-15
            )
            for _ in range(2):  # read, then remembered
                K, camera_from_rig = shard.cameras(view)
                np.testing.assert_array_equal(K, views.K[view])
                np.testing.assert_array_equal(camera_from_rig, views.camera_from_rig[view])
        for name, pool in pools.items():
            for field in ("grid_N3", "low_3", "extent_3", "occupied_N", "part_N", "points_N3"):
                np.testing.assert_array_equal(getattr(shard.pool(name), field), getattr(pool, field))
        shard.verify()


def test_writing_twice_gives_the_same_bytes(tmp_path):
    first, second = small_shard(tmp_path / "a"), small_shard(tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()


def test_a_closed_shard_opens_again_at_the_next_use(tmp_path):
    shard = Shard(small_shard(tmp_path))
    before = shard.rgb(0)
    shard.close()
    np.testing.assert_array_equal(shard.rgb(0), before)
    shard.close()


def test_a_shard_in_use_can_go_to_another_process(tmp_path):
    shard = Shard(small_shard(tmp_path))
    before = shard.rgb(1)
    with pickle.loads(pickle.dumps(shard)) as copy:
        np.testing.assert_array_equal(copy.rgb(1), before)
    shard.close()


def test_an_absent_shard(tmp_path):
    with pytest.raises(UserError, match=r"cup.h5: cannot read the shard"):
        Shard(tmp_path / "cup.h5").rgb(0)


def test_a_shortened_shard_is_an_error(tmp_path):
    path = small_shard(tmp_path, side=8)
    whole = path.read_bytes()
    for length in [0, 1, 8, 100, *range(1000, len(whole), 5000), len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(UserError, match=r"cup\.h5.*delete it and render again"):
            contents(path)


def test_a_flipped_bit_never_changes_what_is_read(tmp_path):
    """Each of 300 flips, spread over the file, is an error or hits padding that nothing reads."""
    path = small_shard(tmp_path, views=2, side=8)
    whole, expected = path.read_bytes(), contents(path)
    errors = []
    for offset in np.linspace(0, len(whole) - 1, 300).astype(int):
        damaged = bytearray(whole)
        damaged[offset] ^= 1 << (offset % 8)
        path.write_bytes(damaged)
        try:
            assert contents(path) == expected, f"silent damage at byte {offset}"
        except UserError as error:
            errors.append(str(error))
    assert len(errors) > 270
    assert all("cup.h5" in error and "\n" not in error for error in errors)


def test_no_text_lies_in_the_unchecked_heap(tmp_path):
    """A flipped bit there can keep HDF5 busy for ever."""
    with h5py.File(small_shard(tmp_path), "r") as file:
        for name in file.attrs:
            string = h5py.check_string_dtype(file.attrs.get_id(name).dtype)
            assert string is None or string.length is not None, name
    assert b"GCOL" not in small_shard(tmp_path).read_bytes()


def test_every_array_has_a_checksum(tmp_path):
    unchecked = []
    with h5py.File(small_shard(tmp_path), "r") as file:
        file.visititems(
            lambda name, node: (
                unchecked.append(name) if isinstance(node, h5py.Dataset) and not node.fletcher32 else None
            )
        )
    assert unchecked == []


def test_verify_finds_damage_in_any_part(tmp_path):
    path = small_shard(tmp_path)
    whole = path.read_bytes()
    with h5py.File(path, "r") as file:
        chunks = {
            name: file[name].id.get_chunk_info(0).byte_offset
            for name in ("mesh/faces", "views/rgb", "views/depth", "points/surface/part")
        }
    for offset in chunks.values():
        damaged = bytearray(whole)
        damaged[offset] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(UserError, match="cannot read the shard"), Shard(path) as shard:
            shard.verify()


def test_another_version_says_so(tmp_path):
    path = small_shard(tmp_path)
    with h5py.File(path, "r+", libver="latest") as file:
        file.attrs["version"] = VERSION + 1
    with pytest.raises(UserError, match=rf"stereo_occ.shard version {VERSION + 1}, expected .* {VERSION}"):
        Shard(path).rgb(0)


def test_any_other_hdf5_file_says_so(tmp_path):
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["x"] = 1
    with pytest.raises(UserError, match=r"is None version None, expected stereo_occ.shard"):
        Shard(path).rgb(0)


@pytest.mark.parametrize(
    ("failure", "raised"),
    [(OSError(5, "Input/output error"), UserError), (KeyboardInterrupt(), KeyboardInterrupt)],
)
def test_a_failed_write_leaves_nothing_new_behind(tmp_path, monkeypatch, failure, raised):
    def fail(_):
        raise failure

    path = small_shard(tmp_path)
    before = path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(raised):
            small_shard(tmp_path, seed=1)
        with pytest.raises(raised):
            small_shard(tmp_path, object_id="pot")
    assert path.read_bytes() == before
    assert {file.name for file in path.parent.iterdir()} == {"cup.h5", "cup.h5.sha256"}


FULL_DISK = """
import resource, sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from samples import small_shard
from stereo_occ.errors import UserError
for limit in (1_000, 40_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        small_shard(Path({folder!r}))
    except UserError as error:
        print(error)
"""


def test_a_full_disk_is_one_line(tmp_path):
    """A limit on the size of files fails like a full disk; HDF5 itself would crash, so this is another process."""
    source = FULL_DISK.format(tests=str(Path(__file__).parents[1]), folder=str(tmp_path))
    run = subprocess.run(
        [sys.executable, "-B", "-c", source], capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert len(lines) == 2
    assert all("cup.h5: cannot write the shard" in line and "File too large" in line for line in lines)
    assert list((tmp_path / "mug").iterdir()) == []


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "mug").write_text("a file where the folder should be")
    with pytest.raises(UserError, match=r"cup.h5: cannot write the shard"):
        small_shard(tmp_path)


def test_what_dead_processes_left_is_removed_and_the_rest_kept(tmp_path):
    path = small_shard(tmp_path)
    dead = multiprocessing.get_context("spawn").Process(target=int)
    dead.start()
    dead.join()
    here = socket.gethostname()
    ours = partial_path(path, here, os.getpid())
    of_no_process = partial_path(path, here, dead.pid)
    another_machines = partial_path(path, "node7.cluster", dead.pid)
    for partial in (ours, of_no_process, another_machines):
        partial.write_bytes(b"")
    remove_partial(path.parent.glob(".*.part"))
    assert set(path.parent.iterdir()) == {path, checksum_path(path), ours, another_machines}
    of_no_process.write_bytes(b"")
    write_whole(path, b"again")
    assert set(path.parent.iterdir()) == {path, checksum_path(path), another_machines}


def test_a_process_that_nobody_has_asked_about_since_it_ended_is_no_more(tmp_path):
    """Its number is still taken, which says nothing of the file it has left."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        partial = partial_path(tmp_path / "cup.h5", socket.gethostname(), process.pid)
        assert not left_behind(partial)
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        os.kill(process.pid, 0)
        assert left_behind(partial)
