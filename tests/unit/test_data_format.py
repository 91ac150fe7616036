"""The ten lines of docs/data-format.md that read a shard without this package."""

import re
from pathlib import Path

import numpy as np
from samples import small_shard

import stereo_occ
from stereo_occ.data.shard import Shard
from stereo_occ.geometry.camera import Camera, transform_points

PAGE = Path(stereo_occ.__file__).parents[1] / "docs" / "data-format.md"


def test_the_example_reads_what_the_package_reads(tmp_path, monkeypatch):
    path = small_shard(tmp_path, "mug", "mug_0000")
    monkeypatch.chdir(path.parent)
    (example,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), flags=re.MULTILINE | re.DOTALL)
    lines = [line for line in example.splitlines() if line and not line.startswith(("import", "with"))]
    assert len(lines) <= 10
    read = {}
    exec(example, read)
    with Shard(path) as shard:
        pool, pose = shard.pool("box"), shard.pose(0).rig_from_object
        np.testing.assert_array_equal(np.stack([read["left"], read["right"]]), shard.rgb(0))
        np.testing.assert_allclose(read["points"], pool.points_N3, atol=1e-6)
        np.testing.assert_array_equal(read["occupied"], pool.occupied_N)
        K, camera_from_rig = (matrix[0] for matrix in shard.cameras(0))
        camera = Camera(K, camera_from_rig, *shard.rgb(0).shape[2:0:-1])
        pixels_N2, _ = camera.project(transform_points(pool.points_N3.astype(np.float64), pose))
    np.testing.assert_allclose(
        np.stack([read["u"], read["v"]], axis=1) / read["w"][:, None], pixels_N2, atol=1e-4
    )


def test_the_table_names_every_array_of_a_shard(tmp_path):
    import h5py

    page = PAGE.read_text()
    with h5py.File(small_shard(tmp_path)) as file:
        names = []
        file.visititems(lambda name, node: names.append(name) if isinstance(node, h5py.Dataset) else None)
        attributes = list(file.attrs)
    assert len(names) > 10
    for name in names:
        assert f"`{re.sub(r'points/[a-z]+', 'points/*', name)}`" in page, name
    assert all(f"`@{name}`" in page for name in attributes)
