"""Damage is found wherever it is."""

import hashlib

import numpy as np
from samples import small_shard

from stereo_occ.data.shard import checksum_path
from stereo_occ.data.verify import verify


def test_a_fresh_shard_is_well_and_its_checksum_is_what_sha256sum_writes(tmp_path):
    path = small_shard(tmp_path)
    assert verify([path], progress=False).well
    assert checksum_path(path).read_text() == f"{hashlib.sha256(path.read_bytes()).hexdigest()}  cup.h5\n"


def test_every_flipped_bit_and_every_lost_byte_is_found(tmp_path):
    path = small_shard(tmp_path, views=2, side=8)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for position in rng.integers(8 * len(whole), size=200):
        damaged = bytearray(whole)
        damaged[position // 8] ^= 1 << (position % 8)
        path.write_bytes(damaged)
        assert list(verify([path], progress=False).damaged) == [path], f"bit {position}"
    for length in (0, 1, *rng.integers(len(whole), size=48)):
        path.write_bytes(whole[:length])
        assert list(verify([path], progress=False).damaged) == [path], f"{length} bytes"
    path.write_bytes(whole)
    assert verify([path], progress=False).well


def test_a_damaged_checksum_is_damage(tmp_path):
    path = small_shard(tmp_path)
    checksum_path(path).write_bytes(b"")
    assert list(verify([path], progress=False).damaged) == [path]


def test_missing_shards_are_named(tmp_path):
    path = small_shard(tmp_path)
    result = verify([path, tmp_path / "pot.h5"], progress=False)
    assert (result.damaged, result.missing) == ({}, [tmp_path / "pot.h5"])
    assert not result.well


def test_without_a_checksum_everything_is_read(tmp_path):
    path = small_shard(tmp_path)
    checksum_path(path).unlink()
    assert verify([path], progress=False).well
    assert verify([path], progress=False).unchecked == [path]
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    path.write_bytes(damaged)
    assert "cup.h5: cannot read the shard" in verify([path], progress=False).damaged[path]
