"""Baselines on scenes whose answer is known; no rendering."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from samples import pools_of, solid, views_of

from stereo_occ.baselines.config import SemiGlobalMatchingConfig, VisualHullConfig, baseline_problems
from stereo_occ.baselines.mean_shape import MeanShape, mean_occupancy
from stereo_occ.baselines.nearest_shape import NearestShape, grid_occupancy
from stereo_occ.baselines.visual_hull import VisualHull
from stereo_occ.data.shard import Shard
from stereo_occ.data.shard_writing import write_shard
from stereo_occ.geometry.camera import Camera, StereoRig, toed_in_rig
from stereo_occ.metrics.solid import mesh_iou
from stereo_occ.predictors import ObjectView
from stereo_occ.shapes.shape import Shape

SIDE = 64
RIG = toed_in_rig(1.0, np.pi / 16, np.pi / 3, SIDE)


def rays(camera, samples=1):
    """Directions ``(H, s, W, s, 3)`` of ``samples`` by ``samples`` rays per pixel."""
    axis = (np.arange(camera.width * samples) + 0.5) / samples - 0.5
    pixels = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    towards = camera.unproject(pixels, np.ones(len(pixels))) - camera.center
    return towards.reshape(camera.height, samples, camera.width, samples, 3)


def ball_mask(camera, radius):
    """Coverage of a ball at the origin, from 8 by 8 rays per pixel."""
    towards = rays(camera, 8)
    along = towards @ -camera.center / np.linalg.norm(towards, axis=-1)
    hits = np.linalg.norm(camera.center) ** 2 - along**2 < radius**2
    return np.rint(255 * hits.mean(axis=(1, 3))).astype(np.uint8)


def seen(masks=None, rgb=None, rig=RIG):
    """A view of no shard: pictures and cameras alone."""
    side = rig.left.width
    shard = SimpleNamespace(
        mask=lambda _: np.full((2, side, side), 255, np.uint8) if masks is None else masks,
        rgb=lambda _: rgb,
        cameras=lambda _: (
            np.stack([camera.K for camera in rig.cameras]),
            np.stack([camera.camera_from_rig for camera in rig.cameras]),
        ),
    )
    return ObjectView(shard, 0)


@pytest.fixture
def shards(tmp_path):
    """Three different solids and one of them again under another name."""
    paths = []
    for name, like in (("a", "a"), ("b", "b"), ("c", "c"), ("copy", "b")):
        shape = solid("mug", like)
        shape = Shape("mug", name, shape.mesh)
        paths.append(tmp_path / f"{name}.h5")
        write_shard(paths[-1], shape, views_of(2), pools_of(shape))
    return [Shard(path) for path in paths]


def test_the_hull_of_a_ball():
    """It holds the ball, ends at its outlines, and is what two cones share."""
    field = VisualHull().look(seen(np.stack([ball_mask(camera, 0.3) for camera in RIG.cameras])))
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (20_000, 3))
    inside = np.linalg.norm(points, axis=1) < 0.29
    assert (field(points[inside]) >= 0.5).all()
    in_cones = np.ones(len(points), bool)
    for camera in RIG.cameras:
        towards = points - camera.center
        along = towards @ -camera.center / np.linalg.norm(towards, axis=1)
        in_cones &= 1 - along**2 < 0.3**2
    assert ((field(points) >= 0.5) == in_cones).mean() > 0.995
    assert field(np.array([[0, 0, 2.0], [3.0, 0, 0]])).tolist() == [0, 0]  # behind the cameras, out of view


def test_logits_and_mesh_say_the_same():
    view = seen(np.stack([ball_mask(camera, 0.3) for camera in RIG.cameras]))
    mesh = VisualHull().mesh(view, None, 32)
    assert mesh.is_volume
    points = torch.rand(1, 5000, 3) - 0.5
    logits = VisualHull().logits([view], None, {"cube": points})["cube"]
    assert logits.isfinite().all()
    assert (logits >= 0).double().mean() == pytest.approx(mesh.volume, rel=0.15)
    nothing = seen(np.zeros((2, SIDE, SIDE), np.uint8))
    assert len(VisualHull().mesh(nothing, None, 32).faces) == 0


def texture(points):
    """A grey value for every point in space, smooth at the scale of a pixel."""
    rng = np.random.default_rng(0)
    waves, phases = rng.normal(0, 12, (40, 2)), rng.uniform(0, 2 * np.pi, 40)
    return (128 + 18 * np.sin(points[..., :2] @ waves.T + phases).sum(-1)).clip(0, 255)


def plane_images(rig, height, slope):
    """The textured plane ``z = height + slope x`` as both cameras see it."""
    images = []
    for camera in rig.cameras:
        towards = rays(camera, 4)
        far = (height + slope * camera.center[0] - camera.center[2]) / (
            towards[..., 2] - slope * towards[..., 0]
        )
        grey = texture(camera.center + far[..., None] * towards).mean(axis=(1, 3))
        images.append(np.repeat(grey[..., None], 3, axis=2).astype(np.uint8))
    return np.stack(images)


def parallel_rig():
    """Parallel cameras whose crops have principal points of their own."""
    cameras = []
    for x, shift in ((-0.1, 11.0), (0.1, -11.0)):
        camera_from_rig = np.diag([1.0, -1.0, -1.0, 1.0])
        camera_from_rig[:3, 3] = [-x, 0, 1]
        K = np.array([[110, 0, 31.5 - shift], [0, 110, 31.5], [0, 0, 1.0]])
        cameras.append(Camera(K, camera_from_rig, SIDE, SIDE))
    return StereoRig(*cameras)


@pytest.mark.parametrize(("height", "slope"), [(0.0, 0.0), (0.2, 0.0), (-0.25, 0.0), (0.0, 0.4), (0.0, -0.4)])
@pytest.mark.parametrize("rig", [RIG, parallel_rig()], ids=["toed_in", "parallel"])
def test_matching_finds_a_textured_plane_before_at_and_behind_the_fixation(rig, height, slope):
    """Depth to a fifth of what one pixel of disparity makes at one metre, 4 to 5 centimetres."""
    pytest.importorskip("cv2")
    from stereo_occ.baselines.rectification import rectify
    from stereo_occ.baselines.semi_global_matching import match

    pair = rectify(rig, 2)
    config = SemiGlobalMatchingConfig("sgm", 2, 9, 1.0, 5, 0.0)
    depth = match(pair, plane_images(rig, height, slope), config)
    found = np.isfinite(depth)
    points = pair.rig.left.unproject(np.argwhere(found)[:, ::-1].astype(float), depth[found])
    middle = (np.abs(points[:, :2]) < 0.1).all(axis=1) & (np.abs(points[:, 2]) < 0.5)
    assert middle.sum() > 300
    error = points[middle, 2] - height - slope * points[middle, 0]
    assert abs(np.median(error)) < 0.005
    assert np.quantile(np.abs(error), 0.8) < 0.02


def test_rectified_cameras_share_rows_and_cover_both_signs():
    pytest.importorskip("cv2")
    from stereo_occ.baselines.rectification import rectify

    pair = rectify(RIG, 2)
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (500, 3))
    (left, depth), (right, other) = (camera.project(points) for camera in pair.rig.cameras)
    assert left[:, 1] == pytest.approx(right[:, 1], abs=1e-6)
    assert depth == pytest.approx(other)
    assert pair.depth(left[:, 0] - right[:, 0]) == pytest.approx(depth)
    centre = [camera.project(np.zeros((1, 3)))[0][0, 0] for camera in pair.rig.cameras]
    assert centre[0] == pytest.approx(centre[1], abs=1e-6)
    low, high = pair.disparities
    assert low < 0 < high
    disparity = left[:, 0] - right[:, 0]
    assert low <= disparity.min()
    assert disparity.max() <= high
    assert np.isinf(pair.depth(np.array([-1e4])))


def test_matching_carves_the_hull_before_a_surface_and_not_behind_it():
    pytest.importorskip("cv2")
    from stereo_occ.baselines.semi_global_matching import SemiGlobalMatching

    config = SemiGlobalMatchingConfig("sgm", 2, 9, 1.0, 5, 0.0)
    field = SemiGlobalMatching(config).look(seen(rgb=plane_images(RIG, 0.1, 0.0)))
    line = np.stack([np.full(9, 0.02), np.full(9, 0.03), np.linspace(-0.3, 0.5, 9)], axis=1)
    assert (field(line) >= 0.5).tolist() == [True] * 4 + [bool(field(line[4:5])[0] >= 0.5)] + [False] * 4
    blank = seen(rgb=np.full((2, SIDE, SIDE, 3), 90, np.uint8))
    assert (
        SemiGlobalMatching(config).look(blank)(line) >= 0.5
    ).mean() > 0.5  # nothing to match: the hull decides


def test_the_mean_of_one_object_is_the_object(shards):
    view = ObjectView(shards[0], 0)
    occupancy = mean_occupancy([view], 8)
    assert occupancy.sum() / 8**3 == pytest.approx(shards[0].mesh.volume, rel=0.1)
    cells = (np.indices((8, 8, 8)).reshape(3, -1).T + 0.5) / 8 - 0.5
    balance = occupancy.ravel() @ cells / occupancy.sum()
    assert balance == pytest.approx(view.pose.to_rig(shards[0].mesh.center_mass[None])[0], abs=0.02)
    field = MeanShape(occupancy).look(ObjectView(shards[1], 1))  # whatever the view
    pool = shards[0].pool("box")
    assert field(view.pose.to_rig(pool.points_N3[pool.occupied_N])).mean() > 0.5
    assert field(np.array([[0.6, 0, 0], [0.45, 0.45, 0.45]])).tolist() == [0, 0]


def test_the_mean_of_two_views_is_half_of_each(shards):
    one, other = (mean_occupancy([ObjectView(shards[0], view)], 8) for view in (0, 1))
    both = mean_occupancy([ObjectView(shards[0], view) for view in (0, 1)], 8)
    assert np.abs(one - other).max() > 0.1
    assert both == pytest.approx((one + other) / 2)


def test_the_nearest_shape_is_the_same_shape_under_another_name(shards):
    baseline = NearestShape(shards[:3], 16)
    assert baseline.nearest(shards[3]).object_id == "b"
    view = ObjectView(shards[3], 1)
    true = shards[3].mesh.apply_transform(view.pose.rig_from_object)
    assert mesh_iou(baseline.mesh(view, None, 8), true) == pytest.approx(1, abs=1e-6)
    points = view.pose.to_rig(shards[3].pool("box").points_N3[:500])
    assert (baseline.look(view)(points) >= 0.5).tolist() == shards[3].pool("box").occupied_N[:500].tolist()


def test_the_grid_of_a_box():
    box = trimesh.creation.box(extents=(0.5, 0.25, 1.0))
    assert grid_occupancy(box, 8).reshape(8, 8, 8).sum() == 4 * 2 * 8


def test_values_that_cannot_be():
    assert baseline_problems(VisualHullConfig()) == []
    assert baseline_problems(SemiGlobalMatchingConfig("sgm", 2, 9, 1.0, 15, 0.02)) == []
    wrong = baseline_problems(SemiGlobalMatchingConfig("sgm", 0, 30, 1.0, 15, 0.02))
    assert [problem.partition(":")[0] for problem in wrong] == [
        "baseline.enlarge=0", "baseline.block=30", "baseline.smoothness=1.0",
    ]  # fmt: skip
    assert "at most 0.379" in wrong[-1]
