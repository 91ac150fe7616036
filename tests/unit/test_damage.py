"""Bits that flip and files that end early: each is reported, or changed nothing that is read."""

import json

import numpy as np
import pytest
import torch
from checkpoints import checkpoint_of
from samples import single_line

from stereo_occ.checkpoint import KEY, read_checkpoint
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.export import export
from stereo_occ.packaged import VERSION


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    """With a state of the optimiser, which is read when a run goes on."""
    moments = {"state": {0: {"exp_avg": torch.randn(50), "step": 7}}, "param_groups": [{"lr": 0.1}]}
    return checkpoint_of(tmp_path_factory.mktemp("run"), optimizer_states=[moments])


@pytest.fixture(scope="module")
def weights(checkpoint, tmp_path_factory):
    output = tmp_path_factory.mktemp("weights") / "tiny"
    export(compose_config("export", [f"checkpoint='{checkpoint}'", f"output='{output}'", "half=false"]))
    return output.with_suffix(".safetensors")


def same(a, b):
    """Whether nested plain values and tensors are equal to the bit."""
    if isinstance(a, torch.Tensor):
        return isinstance(b, torch.Tensor) and a.dtype == b.dtype and torch.equal(a, b)
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def damages(whole, flips, cuts):
    """A file with one bit flipped, at places all over it, then the file cut at places all over it."""
    rng = np.random.default_rng(0)
    for position in rng.integers(8 * len(whole), size=flips):
        damaged = bytearray(whole)
        damaged[position // 8] ^= 1 << (position % 8)
        yield f"bit {position}", bytes(damaged)
    for length in (0, len(whole) - 1, *rng.integers(len(whole), size=cuts - 2)):
        yield f"{length} bytes", whole[:length]


@pytest.mark.parametrize("suffix", [".ckpt", ".safetensors", ".json"])
def test_damage_is_an_error_or_touches_nothing(checkpoint, weights, suffix):
    asked = checkpoint if suffix == ".ckpt" else weights
    path = asked.with_suffix(suffix)
    whole, expected = path.read_bytes(), read_checkpoint(asked)
    reported = []
    for where, damaged in damages(whole, 200, 50):
        path.write_bytes(damaged)
        try:
            assert same(read_checkpoint(asked), expected), f"silent damage: {where}"
        except UserError as error:
            reported.append(str(error))
    path.write_bytes(whole)
    assert len(reported) >= (230 if suffix == ".ckpt" else 245)
    assert all(path.name in line and single_line(line.replace(str(path.parent), "")) for line in reported)
    assert same(read_checkpoint(asked), expected)


def test_torch_itself_does_not_see_damage(checkpoint, tmp_path):
    """Why checkpoints are checked before torch reads them."""
    whole = checkpoint.read_bytes()
    damaged = bytearray(whole)
    damaged[len(whole) // 2] ^= 4
    (tmp_path / "x.ckpt").write_bytes(damaged)
    read = torch.load(tmp_path / "x.ckpt", weights_only=True)
    assert not same(read, torch.load(checkpoint, weights_only=True))
    with pytest.raises(UserError, match=r"x\.ckpt: is damaged, its content differs from its checksums"):
        read_checkpoint(tmp_path / "x.ckpt")


def test_weights_without_checksums_are_read_and_those_of_another_export_are_not(weights, tmp_path):
    description = json.loads(weights.with_suffix(".json").read_text())
    former = {key: value for key, value in description.items() if key not in ("sha256", "checksum")}
    (tmp_path / "w.safetensors").write_bytes(weights.read_bytes())
    (tmp_path / "w.json").write_text(json.dumps(former | {"version": 1}))
    read = read_checkpoint(tmp_path / "w.safetensors")
    assert same(read["state_dict"], read_checkpoint(weights)["state_dict"])
    assert read[KEY]["config"] == description["config"]
    (tmp_path / "w.json").write_text(json.dumps(former | {"version": VERSION}))
    with pytest.raises(UserError, match=r"w\.json is damaged, it differs from its checksum"):
        read_checkpoint(tmp_path / "w.safetensors")
    (tmp_path / "w.json").write_text(json.dumps(former | {"version": VERSION + 1}))
    with pytest.raises(UserError, match=r"w\.json has format version 3, expected 1 or 2; export it again"):
        read_checkpoint(tmp_path / "w.safetensors")
    (tmp_path / "w.json").write_bytes(weights.with_suffix(".json").read_bytes())
    damaged = bytearray(weights.read_bytes())
    damaged[-1] ^= 1
    (tmp_path / "w.safetensors").write_bytes(damaged)
    with pytest.raises(UserError, match=r"w\.safetensors: is damaged, or of another export"):
        read_checkpoint(tmp_path / "w.safetensors")
