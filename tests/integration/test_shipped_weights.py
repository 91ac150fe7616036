"""What is shipped works as it is: no training, a real pair, an answer in metres."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from stereo_occ.geometry.pose import Pose
from stereo_occ.packaged import DEFAULT, FOLDER, shipped
from stereo_occ.paths import PACKAGE
from stereo_occ.reconstructor import Reconstructor, SurfaceOptions
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.trained import load_trained

EXAMPLES = PACKAGE.parent / "examples"
EXAMPLE = ("mug", 99, 3)  # as examples/make_pair.py says


@pytest.fixture(scope="module")
def example():
    """What the default weights make of the example pair."""
    return Reconstructor.from_checkpoint()(
        EXAMPLES / "left.png",
        EXAMPLES / "right.png",
        EXAMPLES / "calibration.yaml",
        surface=SurfaceOptions(resolution=96),
    )


@pytest.fixture(scope="module")
def truth():
    """The mug of the example pair in the left camera's frame, metres."""
    pose = Pose(
        Rotation.from_euler("XY", [30, -35], degrees=True).as_matrix(), 0.16, np.array([0.05, -0.02, -0.5])
    )
    mesh = procedural_shape(*EXAMPLE).mesh.copy().apply_transform(pose.rig_from_object)
    return mesh.apply_transform(np.diag([1.0, -1, -1, 1]))


def test_both_are_there_and_small():
    assert set(shipped()) == {"field", "paper_rig"}
    for name in shipped():
        assert (FOLDER / f"{name}.safetensors").stat().st_size < 10e6
        assert "## Limits" in (FOLDER / f"{name}.md").read_text()
        load_trained(name)


def test_the_example_is_a_closed_mesh_where_the_mug_is(example, truth):
    assert example.mesh.is_watertight
    assert example.mesh.volume > 0
    np.testing.assert_allclose(example.mesh.bounds, truth.bounds, atol=0.015)


def test_its_surface_is_within_a_centimetre(example, truth):
    found_N3, real_N3 = (mesh.sample(5000, seed=0) for mesh in (example.mesh, truth))
    to_real_N, to_found_N = cKDTree(real_N3).query(found_N3)[0], cKDTree(found_N3).query(real_N3)[0]
    assert np.mean(to_real_N) < 0.006
    assert np.mean(to_found_N) < 0.006
    assert np.quantile(to_real_N, 0.95) < 0.015


def test_a_photograph_without_the_object_fools_nobody_about_confidence(example):
    """Noise in the boxes of the example: the model does not believe its own answer."""
    rng = np.random.default_rng(0)
    images = [rng.integers(256, size=(540, 960, 3), dtype=np.uint8) for _ in range(2)]
    boxes = ([477, 214, 623, 368], [364, 214, 510, 368])
    noise = Reconstructor.from_checkpoint(DEFAULT)(
        *images,
        EXAMPLES / "calibration.yaml",
        boxes=boxes,
        surface=SurfaceOptions(resolution=48, threshold=0.05),
    )
    assert noise.confidence < example.confidence
