"""Properties that hold for any camera, pose, crop, shard and prediction: Hypothesis looks for one where they do not."""

import tempfile
from pathlib import Path

import numpy as np
import torch
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from samples import iou, solid
from scipy.spatial.transform import Rotation

from stereo_occ.calibration import Lens, RealCamera, RealPair
from stereo_occ.data.shard import Shard, Views
from stereo_occ.data.shard_writing import write_shard
from stereo_occ.data.splits import split_objects
from stereo_occ.geometry.camera import Camera, StereoRig, transform_points
from stereo_occ.geometry.crop import Box, Crop
from stereo_occ.geometry.cube import triangulate, working_cube
from stereo_occ.geometry.pose import Pose
from stereo_occ.metrics.volumetric import iou_at_thresholds
from stereo_occ.occupancy.pools import PointPool

settings.register_profile("here", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("here")


def numbers(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


rotations = st.tuples(*[numbers(-3, 3)] * 3).map(lambda vector: Rotation.from_rotvec(vector).as_matrix())
centers = st.tuples(*[numbers(-2, 2)] * 3).map(np.array)
poses = st.builds(Pose, rotations, numbers(0.05, 3), centers)
seeds = st.integers(0, 2**32 - 1)


@st.composite
def cameras(draw):
    """Any pinhole camera, anywhere."""
    width, height = draw(st.integers(16, 2000)), draw(st.integers(16, 2000))
    focal = draw(numbers(0.3, 3)) * width
    center = draw(numbers(0.3, 0.7)) * width, draw(numbers(0.3, 0.7)) * height
    K = np.array([[focal, 0, center[0]], [0, draw(numbers(0.9, 1.1)) * focal, center[1]], [0, 0, 1]])
    extrinsics = np.eye(4)
    extrinsics[:3, :3], extrinsics[:3, 3] = draw(rotations), draw(centers)
    return Camera(K, extrinsics, width, height)


@st.composite
def pairs(draw):
    """A pair beside each other, each a little turned, that looks along +Z of the left camera's frame."""
    width, height = draw(st.integers(200, 2000)), draw(st.integers(200, 2000))
    parts = []
    for x in (0.0, draw(numbers(0.03, 0.5))):
        focal = draw(numbers(0.6, 2)) * width
        K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        pose = np.eye(4)
        if x:
            turn = Rotation.from_rotvec(draw(st.tuples(*[numbers(-0.15, 0.15)] * 3))).as_matrix()
            pose[:3, :3], pose[:3, 3] = (
                turn,
                -turn @ [x, draw(numbers(-0.01, 0.01)), draw(numbers(-0.01, 0.01))],
            )
        parts.append(RealCamera(K, Lens(np.zeros(0)), pose, (width, height)))
    return RealPair(*parts)


def points_of(seed, count=20):
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3))


@given(cameras(), seeds)
def test_what_is_projected_is_unprojected_to_where_it_was(camera, seed):
    local_N3 = np.add(points_of(seed), [0, 0, 2])
    points_N3 = transform_points(local_N3, np.linalg.inv(camera.camera_from_rig))
    pixels_N2, depth_N = camera.project(points_N3)
    np.testing.assert_allclose(depth_N, local_N3[:, 2], atol=1e-9)
    np.testing.assert_allclose(camera.unproject(pixels_N2, depth_N), points_N3, atol=1e-7)


@given(poses, seeds)
def test_poses_lead_there_and_back_and_are_their_matrices(pose, seed):
    points_N3 = points_of(seed)
    there_N3 = pose.to_rig(points_N3)
    np.testing.assert_allclose(pose.to_object(there_N3), points_N3, atol=1e-9)
    np.testing.assert_allclose(transform_points(points_N3, pose.rig_from_object), there_N3, atol=1e-9)
    again = Pose.from_matrix(pose.rig_from_object)
    np.testing.assert_allclose(again.to_rig(points_N3), there_N3, atol=1e-9)
    distances = [np.linalg.norm(np.diff(p_N3, axis=0), axis=1) for p_N3 in (points_N3, there_N3)]
    np.testing.assert_allclose(distances[1], pose.scale * distances[0], rtol=1e-9)


@given(cameras(), numbers(-50, 1000), numbers(-50, 1000), numbers(5, 800), st.integers(4, 300), seeds)
def test_the_camera_of_a_crop_sees_points_where_the_crop_shows_them(camera, left, top, extent, side, seed):
    points_N3 = transform_points(np.add(points_of(seed), [0, 0, 2]), np.linalg.inv(camera.camera_from_rig))
    pixels_N2, _ = camera.project(points_N3)
    cropped_N2, _ = Crop(left, top, extent, side).camera(camera).project(points_N3)
    scale = side / extent
    np.testing.assert_allclose(cropped_N2, (pixels_N2 - [left, top]) * scale - 0.5, rtol=1e-9, atol=1e-6)


@given(pairs(), seeds)
def test_a_rectified_pair_has_one_row_for_every_point_and_the_same_rays(pair, seed):
    points_N3 = 0.3 * points_of(seed) + [0, 0, 1]
    rig = pair.rectified()
    (left_N2, depth_N), (right_N2, _) = (camera.project(points_N3) for camera in rig.cameras)
    np.testing.assert_allclose(left_N2[:, 1], right_N2[:, 1], atol=1e-6)
    np.testing.assert_allclose(
        left_N2[:, 0] - right_N2[:, 0], rig.left.K[0, 0] * pair.baseline / depth_N, rtol=1e-6
    )


@given(pairs(), st.tuples(numbers(-0.1, 0.1), numbers(-0.1, 0.1), numbers(0.5, 2)), numbers(0.05, 0.2))
def test_the_working_cube_is_where_the_object_is(pair, where, size):
    rig = pair.pinholes()
    where_3 = np.array(where)
    pixels = [camera.project(where_3[None])[0][0] for camera in rig.cameras]
    np.testing.assert_allclose(triangulate(rig, tuple(map(tuple, pixels))), where_3, atol=1e-6)
    rectified = pair.rectified()
    ball_N3 = where_3 + size / 2 * points_of(0, 200) / np.linalg.norm(
        points_of(0, 200), axis=1, keepdims=True
    )
    boxes = tuple(Box.around(camera.project(ball_N3)[0]) for camera in rectified.cameras)
    cube = working_cube(rectified, boxes, 32)
    inside_N3 = transform_points(ball_N3, cube.cube_from_source)
    assert np.abs(inside_N3).max() < 0.5
    for before, after, crop in zip(rectified.cameras, cube.rig.cameras, cube.crops, strict=True):
        pixels_N2, _ = before.project(ball_N3)
        shown_N2, _ = after.project(inside_N3)
        scale = crop.side / crop.extent
        np.testing.assert_allclose(shown_N2, (pixels_N2 - [crop.left, crop.top]) * scale - 0.5, atol=1e-6)
    assert isinstance(cube.rig, StereoRig)


@st.composite
def shards(draw):
    """Any content of the right types."""
    count, side = draw(st.integers(1, 4)), draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(seeds))
    views = Views(
        rgb=draw(arrays(np.uint8, (count, 2, side, side, 3))),
        mask=draw(arrays(np.uint8, (count, 2, side, side))),
        depth=draw(arrays(np.float16, (count, 2, side, side))),
        K=rng.standard_normal((count, 2, 3, 3)),
        camera_from_rig=rng.standard_normal((count, 2, 4, 4)),
        rig_from_object=np.stack([draw(poses).rig_from_object for _ in range(count)]),
    )
    points = draw(st.integers(1, 30))
    grid_N3 = draw(arrays(np.uint16, (points, 3)))
    part_N = draw(arrays(np.uint8, points, elements=st.integers(0, 3)))
    pool = PointPool(grid_N3, rng.standard_normal(3), rng.random(3), part_N > 0, part_N)
    return views, pool


@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(shards())
def test_a_shard_gives_back_what_it_was_given(content):
    views, pool = content
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mug" / "cup.h5"
        write_shard(path, SOLID, views, {"box": pool, "surface": pool})
        with Shard(path) as shard:
            assert len(shard) == len(views.rgb)
            for view in range(len(shard)):
                assert shard.rgb(view).tobytes() == views.rgb[view].tobytes()
                assert shard.mask(view).tobytes() == views.mask[view].tobytes()
                assert shard.depth(view).tobytes() == views.depth[view].tobytes()
                np.testing.assert_array_equal(shard.cameras(view)[0], views.K[view])
                np.testing.assert_array_equal(shard.cameras(view)[1], views.camera_from_rig[view])
                np.testing.assert_allclose(shard.pose(view).rig_from_object, views.rig_from_object[view])
            for name in ("box", "surface"):
                for part in ("grid_N3", "low_3", "extent_3", "part_N", "occupied_N", "points_N3"):
                    np.testing.assert_array_equal(getattr(shard.pool(name), part), getattr(pool, part))


SOLID = solid("mug", "cup")

labels = array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=40).flatmap(
    lambda shape: st.tuples(arrays(np.bool_, shape), arrays(np.bool_, shape))
)


@given(labels)
def test_iou_is_a_share_symmetric_and_one_for_itself(both):
    a_BN, b_BN = map(torch.from_numpy, both)
    values_B = iou(a_BN, b_BN)
    assert ((values_B >= 0) & (values_B <= 1)).all()
    assert torch.equal(values_B, iou(b_BN, a_BN))
    assert torch.equal(iou(a_BN, a_BN), torch.ones(len(a_BN)))
    assert torch.equal(values_B == 1, (a_BN == b_BN).all(dim=1))
    order = torch.randperm(a_BN.shape[1], generator=torch.Generator().manual_seed(0))
    assert torch.equal(values_B, iou(a_BN[:, order], b_BN[:, order]))


@given(labels, seeds)
def test_scores_at_many_thresholds_are_those_at_each(both, seed):
    occupied_BN = torch.from_numpy(both[0])
    generator = torch.Generator().manual_seed(seed)
    logits_BN = 3 * torch.randn(occupied_BN.shape, generator=generator)
    thresholds_T = torch.linspace(0.1, 0.9, 9)
    values_BT = iou_at_thresholds(logits_BN, occupied_BN, thresholds_T)
    for column, threshold in enumerate(thresholds_T):
        predicted_BN = logits_BN.double() >= torch.logit(threshold.double())
        intersection_B, union_B = (predicted_BN & occupied_BN).sum(1), (predicted_BN | occupied_BN).sum(1)
        expected_B = torch.where(union_B == 0, 1.0, intersection_B / union_B.clamp(min=1))
        torch.testing.assert_close(values_BT[:, column], expected_B)


@given(
    st.lists(st.tuples(st.sampled_from(["mug", "bowl"]), st.integers(0, 999)), unique=True, max_size=60),
    seeds,
)
def test_no_object_is_lost_or_in_two_subsets(named, seed):
    objects = [(category, f"{category}_{index}") for category, index in named]
    counts = [sum(category == name for category, _ in objects) for name in ("mug", "bowl")]
    assume(all(count == 0 or count >= 3 for count in counts))
    subsets = split_objects(objects, [0.8, 0.1, 0.1], seed)
    assert sorted(key for keys in subsets.values() for key in keys) == sorted(objects)
    assert subsets == split_objects(objects[::-1], [0.8, 0.1, 0.1], seed)
