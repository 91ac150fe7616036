"""What former versions wrote is read as it was meant."""

import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from samples import solid, views_of

from stereo_occ.checkpoint import KEY, plain, read_checkpoint
from stereo_occ.data.shard import Shard
from stereo_occ.data.verify import verify
from stereo_occ.models.base import StereoViews
from stereo_occ.resume import step_to_resume
from stereo_occ.saved_config import training_config
from stereo_occ.trained import load_trained

V1 = Path(__file__).parents[1] / "fixtures" / "v1"

#: Logits at the points of :func:`answer`, of the program that wrote the checkpoint.
SAID = [0.268351, 0.102442, -0.010133, -0.155299]


@pytest.fixture
def checkpoint(tmp_path):
    path = tmp_path / "last.ckpt"
    path.write_bytes(gzip.decompress((V1 / "last.ckpt.gz").read_bytes()))
    return path


def test_shards_of_version_1():
    with Shard(V1 / "cup.h5") as shard:
        expected, shape = views_of(2, 8), solid("mug", "cup")
        assert (shard.category, shard.object_id, shard.facts) == ("mug", "cup", {"kind": "box"})
        for view in range(2):
            np.testing.assert_array_equal(shard.rgb(view), expected.rgb[view])
            np.testing.assert_array_equal(shard.depth(view), expected.depth[view])
            np.testing.assert_array_equal(shard.cameras(view)[1], expected.camera_from_rig[view])
        assert shard.mesh.volume == pytest.approx(shape.mesh.volume, rel=1e-5)
        assert shard.pool("box").occupied_N.tolist() == [bool(part) for part in shard.pool("box").part_N]
    assert verify([V1 / "cup.h5"], progress=False).well


def answer(name: Path) -> np.ndarray:
    trained = load_trained(str(name))
    images_2 = torch.linspace(0, 1, 2 * 3 * 16 * 16).reshape(2, 1, 3, 16, 16)
    rows_N3 = np.linspace(-0.4, 0.4, 12, dtype=np.float32).reshape(4, 3)
    K_1233 = torch.tensor([[14.0, 0, 7.5], [0, 14, 7.5], [0, 0, 1]]).expand(1, 2, 3, 3)
    return trained.predict(StereoViews(images_2[0], images_2[1], K_1233, torch.eye(4).expand(1, 2, 4, 4)))(
        rows_N3
    )


def test_checkpoints_and_weights_of_version_1_say_what_they_said(checkpoint, tmp_path):
    for name in ("weights.safetensors", "weights.json"):
        shutil.copy(V1 / name, tmp_path / name)
    said = answer(checkpoint)
    np.testing.assert_allclose(said, SAID, atol=1e-4)
    np.testing.assert_allclose(answer(tmp_path / "weights"), said, atol=1e-6)


def test_a_run_of_version_1_goes_on(checkpoint):
    saved = read_checkpoint(checkpoint)
    config = plain(training_config(saved[KEY]["config"]))
    assert step_to_resume(checkpoint, config, {"train": ["a"], "val": ["b"]}) == 12
    assert saved["optimizer_states"][0]["state"]
    assert saved[KEY]["training_weights"].keys() == {
        name.removeprefix("model.") for name in saved["state_dict"] if name.startswith("model.")
    }
