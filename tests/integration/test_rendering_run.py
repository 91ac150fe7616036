"""Rendering a data set: the same bytes however it is done, and nothing twice."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
import trimesh
from omegaconf import OmegaConf
from runs import program

from stereo_occ.cli import compose_config
from stereo_occ.data import prepare as prepare_module
from stereo_occ.data.config import SliceConfig
from stereo_occ.data.prepare import prepare
from stereo_occ.data.shard import Shard
from stereo_occ.errors import UserError
from stereo_occ.writing import left_behind, partial_path

SMALL = [
    "data.image_side=32", "data.views=2", "data.pool_size=500", "scale.counts={mug:2,bowl:1,bottle:1}",
    "progress=false",
]  # fmt: skip


def render(folder, *overrides, workers=1):
    cfg = compose_config("render", [*SMALL, f"paths.data={folder}", f"workers={workers}", *overrides])
    return prepare(OmegaConf.to_object(cfg), progress=False)


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.h5")}


def times(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rendered")
    render(folder)
    return folder


def test_the_number_of_processes_changes_no_byte(rendered, tmp_path):
    render(tmp_path, workers=2)
    assert contents(tmp_path) == contents(rendered)
    assert len(contents(rendered)) == 4


def test_a_complete_data_set_is_left_alone(rendered, monkeypatch):
    before = times(rendered)
    monkeypatch.setattr(prepare_module, "render_object", lambda *_: pytest.fail("rendered again"))
    assert len(render(rendered).paths) == 4
    assert times(rendered) == before


def test_an_interrupted_rendering_goes_on_where_it_stopped(rendered, tmp_path, monkeypatch):
    render_object, done = prepare_module.render_object, []

    def interrupted(*args):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(render_object(*args))

    with monkeypatch.context() as patch:
        patch.setattr(prepare_module, "render_object", interrupted)
        with pytest.raises(KeyboardInterrupt):
            render(tmp_path)
    first = times(tmp_path)
    assert len(first) == 2
    of_no_process = partial_path(next(iter(first)), socket.gethostname(), 2**22 - 1)
    of_no_process.write_bytes(b"half a shard of a process that was killed")
    render(tmp_path)
    assert contents(tmp_path) == contents(rendered)
    assert {path: time for path, time in times(tmp_path).items() if path in first} == first
    assert not of_no_process.exists()


def test_objects_do_not_depend_on_which_others_there_are(rendered, tmp_path):
    render(tmp_path, "categories=mug", "scale.counts.mug=1")
    (path,) = contents(tmp_path)
    assert contents(tmp_path)[path] == contents(rendered)[path]


def test_whatever_changes_the_pictures_has_a_folder_of_its_own(rendered):
    (used,) = rendered.iterdir()
    names = {used.name}
    changes = [
        "data.seed=1", "data.views=3", "data.image_side=48", "data.pool_size=400", "placement=free",
        "rig.fov_deg=50", "lights=random", "material=varied", "background=uniform",
    ]  # fmt: skip
    for change in changes:
        cfg = compose_config("render", [*SMALL, f"paths.data={rendered}", change])
        names.add(prepare_module._folder_name(OmegaConf.to_object(cfg)))
    assert len(names) == len(changes) + 1
    for change in ("data.split=view", "data.fractions=[0.6,0.2,0.2]", "categories=mug", "scale.counts.mug=9"):
        cfg = compose_config("render", [*SMALL, f"paths.data={rendered}", change])
        assert prepare_module._folder_name(OmegaConf.to_object(cfg)) == used.name


def test_the_folder_says_what_it_holds(rendered):
    (folder,) = rendered.iterdir()
    description = json.loads((folder / "dataset.json").read_text())
    assert description["data"]["image_side"] == 32
    assert description["placement"]["kind"] == "paper"


def test_shards_show_the_object_where_the_pose_says(rendered):
    """The mask of each image covers the projected vertices, and depth lies within the object's reach."""
    for path in rendered.rglob("*.h5"):
        with Shard(path) as shard:
            for view in range(len(shard)):
                posed_N3 = shard.pose(view).to_rig(shard.mesh.vertices)
                for side, mask, depth in zip((0, 1), shard.mask(view), shard.depth(view), strict=True):
                    K, camera_from_rig = (array[side] for array in shard.cameras(view))
                    camera_N3 = posed_N3 @ camera_from_rig[:3, :3].T + camera_from_rig[:3, 3]
                    pixels_N2 = (camera_N3 @ K.T)[:, :2] / camera_N3[:, 2:]
                    v, u = np.nonzero(mask > 0)
                    assert np.abs(pixels_N2.min(axis=0) - [u.min(), v.min()]).max() <= 1
                    assert np.abs(pixels_N2.max(axis=0) - [u.max(), v.max()]).max() <= 1
                    seen = depth[depth > 0].astype(float)
                    low, high = camera_N3[:, 2].min(), camera_N3[:, 2].max()
                    assert low - 2e-3 <= seen.min() <= seen.max() <= high + 2e-3


def test_a_mesh_that_changed_is_rendered_again(tmp_path):
    """Its file has the same name; the shard of the old one must not be taken for it."""
    model = tmp_path / "meshes" / "mug" / "mine" / "model.obj"
    model.parent.mkdir(parents=True)
    overrides = ["data=meshes", f"data.root={tmp_path / 'meshes'}", "data.image_side=32", "data.views=1"]
    ratios = []
    for extents in ((1, 2, 1), (1, 2, 1), (1, 5, 1)):
        trimesh.creation.box(extents=extents).export(model)
        cfg = compose_config(
            "render", [*overrides, "data.pool_size=100", f"paths.data={tmp_path}", "workers=1"]
        )
        (path,) = prepare(OmegaConf.to_object(cfg), progress=False).paths
        with Shard(path) as shard:
            assert (shard.category, shard.object_id) == ("mug", "mine")
            ratios.append(shard.mesh.extents.max() / shard.mesh.extents.min())
    assert ratios == pytest.approx([2, 2, 5])
    assert len(contents(tmp_path)) == 2


def test_slices_are_the_whole_and_share_a_folder(rendered, tmp_path):
    parts = []
    for index in (2, 1, 3):
        cfg = compose_config("render", [*SMALL, f"paths.data={tmp_path}", "workers=1"])
        typed = OmegaConf.to_object(cfg)
        parts.append(prepare(typed, progress=False, part=SliceConfig(index, 3)).paths)
    assert sorted(map(len, parts)) == [1, 1, 2]
    assert contents(tmp_path) == contents(rendered)


def test_killed_at_any_moment_it_goes_on_to_the_same_bytes(rendered, tmp_path):
    arguments = [sys.executable, "-m", "stereo_occ.render", *SMALL, f"paths.data={tmp_path}", "workers=2"]
    process = subprocess.Popen(
        arguments, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    while not contents(tmp_path) and process.poll() is None:
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    while not all(map(left_behind, tmp_path.rglob("*.part"))):
        time.sleep(0.01)
    first = times(tmp_path)
    assert first
    render(tmp_path, workers=2)
    assert contents(tmp_path) == contents(rendered)
    assert {path: time for path, time in times(tmp_path).items() if path in first} == first
    assert not list(tmp_path.rglob("*.part"))


def test_verify_names_what_is_damaged_or_missing_and_exits_with_1(rendered, tmp_path):
    shutil.copytree(rendered, tmp_path / "data")
    arguments = ["-m", "stereo_occ.render", *SMALL, "paths.data=data", "verify=true"]
    done = program(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "all 4 shards in data/" in done.stdout
    damaged, missing, *_ = sorted((tmp_path / "data").rglob("*.h5"))
    with damaged.open("r+b") as file:
        file.truncate(1000)
    missing.unlink()
    done = program(*arguments, cwd=tmp_path)
    assert done.returncode == 1
    *found, verdict = done.stderr.splitlines()
    assert found == [
        f"damaged {damaged.relative_to(tmp_path)}: the file differs from its checksum",
        f"missing {missing.relative_to(tmp_path)}",
    ]
    assert verdict.startswith("stereo_occ: of 4 shards 1 are damaged and 1 missing; delete the damaged files")
    assert "Error" not in done.stdout + done.stderr


def test_a_killed_rendering_process_is_one_line(tmp_path, monkeypatch):
    """A renderer that dies as if the system had killed it, with a second one at work."""
    monkeypatch.setattr(prepare_module, "render_object", die)
    with pytest.raises(UserError, match=r"workers=2: a rendering process was killed"):
        render(tmp_path, workers=2)
    assert contents(tmp_path) == {}


def die(*_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "data").write_text("a file where the folder should be")
    with pytest.raises(UserError, match=r"paths.data=.*data: cannot be written"):
        render(tmp_path / "data")


def test_the_command(rendered, tmp_path):
    arguments = ["-m", "stereo_occ.render", *SMALL, "paths.data=data", "workers=1"]
    done = program(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert contents(tmp_path / "data") == contents(rendered)
    assert "4 objects in data/procedural_32px" in done.stdout + done.stderr
