"""From a pair of photographs to a mesh in metres, with a model that needs no training: what both silhouettes leave.

The photographs are of a ball, drawn ray by ray, so the lenses' distortion is exact and no renderer is needed.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf
from PIL import Image
from scipy.spatial.transform import Rotation

from stereo_occ.calibration import Lens, RealCamera, RealPair
from stereo_occ.checkpoint import plain
from stereo_occ.cli import compose_config
from stereo_occ.decision import Decision
from stereo_occ.errors import UserError
from stereo_occ.geometry.crop import Box
from stereo_occ.models.sampling import project_points, sample_maps
from stereo_occ.photographs import detect
from stereo_occ.reconstructor import Reconstructor, SurfaceOptions
from stereo_occ.saved_config import training_config

CENTER, RADIUS = np.array([0.05, 0.04, 0.6]), 0.05
W, H = 640, 360
COARSE = SurfaceOptions(resolution=32, steps=0)


def pair_of(turn_deg=(0.0, 0, 0), distortion=(0.0,) * 5, toe_in=None):
    """Parallel cameras, the right one turned; or looking at a point 0.5 m away."""
    K = np.array([[450.0, 0, (W - 1) / 2], [0, 450, (H - 1) / 2], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("XYZ", turn_deg, degrees=True).as_matrix()
    pose[:3, 3] = -pose[:3, :3] @ [0.08, 0, 0]
    lens = Lens.from_list(distortion)
    return RealPair(RealCamera(K, lens, np.eye(4), (W, H)), RealCamera(K, lens, pose, (W, H)))


def photograph(camera, center=CENTER, radius=RADIUS):
    """A dark ball before white."""
    v, u = np.mgrid[: camera.size[1], : camera.size[0]]
    rays_N3 = camera.rays(np.stack([u, v], axis=-1).reshape(-1, 2).astype(float)) @ camera.rotation_33
    rays_N3 /= np.linalg.norm(rays_N3, axis=1, keepdims=True)
    to_ball_3 = center - camera.center_3
    along_N = rays_N3 @ to_ball_3
    hit = (along_N > 0) & (to_ball_3 @ to_ball_3 - along_N**2 < radius**2)
    return np.where(hit.reshape(camera.size[::-1])[..., None], [60, 80, 100], 255).astype(np.uint8)


def silhouettes(views):
    """Occupied is what is dark in both images, by the cameras that the model is told."""
    images_VB3HW = torch.stack([views.left_BCHW, views.right_BCHW])
    dark_VB1HW = 1 - images_VB3HW.mean(dim=2, keepdim=True)

    def occupancy(points_N3):
        height, width = images_VB3HW.shape[-2:]
        where = project_points(
            torch.as_tensor(points_N3)[None],
            views.K_B233.transpose(0, 1),
            views.camera_from_rig_B244.transpose(0, 1),
            width,
            height,
        )
        dark_VN = sample_maps(dark_VB1HW, where.positions_VBN2)[:, 0, 0] * where.visible_VBN[:, 0]
        return (20 * (dark_VN.amin(dim=0) - 0.34)).numpy()

    return occupancy


@cache
def training(*overrides):
    cfg = compose_config("train", ["model=mono", "model.encoder.weights=null", "scale=laptop", *overrides])
    return OmegaConf.to_object(training_config(plain(cfg)))


def reconstructor(*overrides):
    return Reconstructor(training(*overrides), silhouettes, Decision(0.5), "silhouettes")


def on_object(*overrides):
    return reconstructor("rig=rectified", "placement=free", *overrides)


def middle(mesh):
    return mesh.bounds.mean(axis=0)


def check_outline(result, images, tolerance=2.5):
    """The mesh fills the ball's box in both photographs, to pixels."""
    for camera, image in zip(result.pair.cameras, images, strict=True):
        seen, true = Box.around(camera.pixels(result.mesh.vertices)), box_of(image)
        np.testing.assert_allclose(list(vars(seen).values()), list(vars(true).values()), atol=tolerance)


def box_of(image):
    return Box.of_mask(image.min(axis=2) < 128)


PAIRS = {
    "parallel": pair_of(),
    "turned": pair_of((1.0, 3.0, -1.5)),
    "distorted": pair_of(distortion=(-0.3, 0.1, 0.001, -0.002, 0.0)),
    "both": pair_of((-1.0, 4.0, 1.0), (-0.3, 0.1, 0.001, -0.002, 0.0)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_mesh_is_where_the_object_is_in_the_left_cameras_frame(name):
    """What both silhouettes leave is seen where the ball is, in both photographs; in depth it is longer."""
    pair = PAIRS[name]
    images = [photograph(camera) for camera in pair.cameras]
    result = on_object()(*images, pair, surface=COARSE)
    check_outline(result, images)
    assert middle(result.mesh)[2] == pytest.approx(CENTER[2], abs=0.02)
    assert result.mesh.is_watertight
    assert result.mesh.volume > 0
    assert [part.how for part in result.found] == ["plain background"] * 2
    # A pixel of disparity, to which boxes are found here, is 10 mm of depth.
    np.testing.assert_array_less(np.abs(result.left_from_cube[:3, 3] - CENTER), [0.001, 0.001, 0.012])
    assert 0.2 < result.unit < 0.25  # 1.5 times the diagonal of the ball's box, 0.14 m


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("name", PAIRS)
def test_a_box_in_one_image_is_found_in_the_other(name, index):
    pair = PAIRS[name]
    images = [photograph(camera) for camera in pair.cameras]
    truth = [list(vars(box_of(image)).values()) for image in images]
    boxes = (truth[0], None) if index == 0 else (None, truth[1])
    result = on_object()(*images, pair, boxes=boxes, surface=COARSE)
    assert result.found[1 - index].how == f"like the {'right' if index else 'left'} one"
    np.testing.assert_allclose(list(vars(result.found[1 - index].box).values()), truth[1 - index], atol=2)


def test_what_the_other_image_does_not_show_is_not_found_there():
    """At the left edge of the left image; the right camera sees that part of the world outside of its own."""
    pair = PAIRS["parallel"]
    images = [np.full((H, W, 3), 255, np.uint8) for _ in range(2)]
    for image in images:
        image[190:] = 60
    images[0][150:230, 5:35] = [200, 40, 40]
    with pytest.raises(UserError, match=r"right: (what is in the left|nothing in it)"):
        on_object()(*images, pair, boxes=([0, 140, 40, 240], None), surface=COARSE)


@pytest.mark.parametrize("index", [0, 1])
def test_fisheye_lenses_whose_images_end_beyond_90_degrees(index):
    K = np.array([[190.0, 0, 319.5], [0, 190, 239.5], [0, 0, 1]])
    lens = Lens.from_list([0.02, -0.01, 0.002, 0.0], fisheye=True)
    pose = np.eye(4)
    pose[0, 3] = -0.1
    pair = RealPair(RealCamera(K, lens, np.eye(4), (640, 480)), RealCamera(K, lens, pose, (640, 480)))
    images = [np.full((480, 640, 3), 255, np.uint8) for _ in range(2)]
    for camera, image in zip(pair.cameras, images, strict=True):
        v, u = np.mgrid[150:330, 220:420]
        rays_N3 = camera.rays(np.stack([u, v], axis=-1).reshape(-1, 2).astype(float))
        rays_N3 /= np.linalg.norm(rays_N3, axis=1, keepdims=True)
        to_ball_3 = np.array([0.05, 0.02, 0.4]) - camera.center_3
        outside_N = to_ball_3 @ to_ball_3 - (rays_N3 @ to_ball_3) ** 2
        image[150:330, 220:420][(outside_N < 0.06**2).reshape(u.shape)] = [60, 80, 100]
    truth = [list(vars(box_of(image)).values()) for image in images]
    boxes = (truth[0], None) if index == 0 else (None, truth[1])
    result = on_object()(*images, pair, boxes=boxes, surface=COARSE)
    np.testing.assert_allclose(list(vars(result.found[1 - index].box).values()), truth[1 - index], atol=2)


def test_a_strong_lens_and_a_wide_baseline_leave_the_search_in_the_image():
    K = np.array([[533.0, 0, 319.5], [0, 533, 239.5], [0, 0, 1]])
    lens = Lens.from_list([-0.2656, -0.0467, 0.0018, -0.0003, 0.2523])
    pose = np.eye(4)
    pose[0, 3] = -0.4
    pair = RealPair(RealCamera(K, lens, np.eye(4), (640, 480)), RealCamera(K, lens, pose, (640, 480)))
    for x in (0.15, 0.3):
        images = [photograph(camera, np.array([x, 0.1, 1.0]), 0.08) for camera in pair.cameras]
        left, right = (list(vars(box_of(image)).values()) for image in images)
        result = on_object()(*images, pair, boxes=(left, None), surface=COARSE)
        np.testing.assert_allclose(list(vars(result.found[1].box).values()), right, atol=2)


def test_one_mask_is_a_box_and_not_enough_where_pictures_had_no_background():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    mask = images[0].min(axis=2) < 128
    with pytest.raises(
        UserError, match="trained on pictures without a background: give left_mask= and right_mask="
    ):
        on_object()(*images, pair, masks=(mask, None), surface=COARSE)
    result = on_object("background=clutter")(*images, pair, masks=(mask, None), surface=COARSE)
    check_outline(result, images)


def test_nothing_is_looked_for_where_the_whole_view_is_taken():
    pair = toed_in_pair()
    images = [photograph(camera) for camera in pair.cameras]
    with pytest.raises(UserError, match=r"find, center, size: .* have no effect"):
        reconstructor("rig=paper")(*images, pair, find="mug", surface=COARSE)


def test_what_is_detected_on_the_left_is_found_on_the_right(monkeypatch):
    pair = PAIRS["turned"]
    images = [photograph(camera) for camera in pair.cameras]
    box_4 = torch.tensor(list(vars(box_of(images[0])).values()))
    cup = detect.WEIGHTS.meta["categories"].index("cup")
    said = (box_4[None] + 0.5, torch.tensor([cup]), torch.tensor([0.9]))
    monkeypatch.setattr(detect, "detections", lambda photo: said)
    result = on_object()(*images, pair, find="mug", surface=COARSE)
    assert [part.how for part in result.found] == ["detected with 0.90", "like the left one"]
    check_outline(result, images)


def test_the_size_of_the_images_does_not_matter():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    small = [np.asarray(Image.fromarray(image).reduce(2)) for image in images]
    whole, half = (on_object()(*pictures, pair, surface=COARSE) for pictures in (images, small))
    assert half.unit == pytest.approx(whole.unit, rel=0.02)
    check_outline(half, small)
    np.testing.assert_allclose(half.left_from_cube[:3, 3], whole.left_from_cube[:3, 3], atol=0.012)
    assert half.mesh.volume == pytest.approx(whole.mesh.volume, rel=0.1)


@pytest.mark.parametrize("index", [0, 1])
def test_cameras_with_images_of_different_size(index):
    """Twice the pixels and a third of the height cut off below: the same scene comes out."""
    pair = PAIRS["turned"]
    plain_ = on_object()(*[photograph(camera) for camera in pair.cameras], pair, surface=COARSE)
    cameras = list(pair.cameras)
    K = cameras[index].K.copy()
    K[:2, 2] += 0.5
    K[:2] *= 2
    K[:2, 2] -= 0.5
    cameras[index] = replace(cameras[index], K=K, size=(2 * W, 2 * H - H // 3))
    mixed = RealPair(*cameras)
    images = [photograph(camera) for camera in cameras]
    result = on_object()(*images, mixed, surface=COARSE)
    check_outline(result, images, tolerance=4)
    np.testing.assert_allclose(middle(result.mesh), middle(plain_.mesh), atol=0.006)
    assert result.mesh.volume == pytest.approx(plain_.mesh.volume, rel=0.1)


def test_a_scene_of_twice_the_size_looks_the_same_and_comes_out_twice_as_large():
    pair = PAIRS["turned"]
    pose = pair.right.camera_from_left.copy()
    pose[:3, 3] *= 2
    large = RealPair(pair.left, replace(pair.right, camera_from_left=pose))
    images = [photograph(camera) for camera in pair.cameras]
    one, two = (on_object()(*images, rig, surface=COARSE) for rig in (pair, large))
    np.testing.assert_allclose(two.mesh.vertices, 2 * one.mesh.vertices, rtol=1e-4, atol=1e-5)


def test_boxes_masks_and_the_background_find_the_same():
    pair = PAIRS["both"]
    images = [photograph(camera) for camera in pair.cameras]
    masks = tuple(image.min(axis=2) < 128 for image in images)
    plain_ = on_object()(*images, pair, surface=COARSE)
    masked = on_object()(*images, pair, masks=masks, surface=COARSE)
    boxes = tuple(list(vars(box_of(image)).values()) for image in images)
    boxed = on_object()(*images, pair, boxes=boxes, surface=COARSE)
    np.testing.assert_allclose(masked.mesh.vertices, plain_.mesh.vertices, atol=1e-9)
    np.testing.assert_allclose(middle(boxed.mesh), middle(plain_.mesh), atol=0.003)


def test_a_mask_takes_away_what_is_around_the_object():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    masks = tuple(image.min(axis=2) < 128 for image in images)
    littered = [image.copy() for image in images]
    for image in littered:
        image[:, ::7] = 0
    clean, dirty = (
        on_object()(*pictures, pair, masks=masks, surface=COARSE) for pictures in (images, littered)
    )
    assert dirty.mesh.volume == pytest.approx(clean.mesh.volume, rel=0.15)


def test_where_the_object_is_may_be_said_in_metres():
    pair = PAIRS["turned"]
    images = [photograph(camera) for camera in pair.cameras]
    result = on_object()(*images, pair, center=CENTER.tolist(), size=0.16, surface=COARSE)
    assert result.found is None
    check_outline(result, images)
    np.testing.assert_allclose(result.left_from_cube[:3, 3], CENTER, atol=1e-9)


def test_a_mask_counts_beside_centre_and_size():
    """They replace what is measured from it, no more."""
    pair = PAIRS["turned"]
    images = [photograph(camera) for camera in pair.cameras]
    masks = tuple(image.min(axis=2) < 128 for image in images)
    result = on_object()(*images, pair, masks=masks, center=CENTER.tolist(), size=0.16, surface=COARSE)
    assert result.found is not None
    np.testing.assert_array_equal(result.found[0].mask_HW, masks[0])
    np.testing.assert_allclose(result.left_from_cube[:3, 3], CENTER, atol=1e-9)


def test_what_speaks_against_an_answer_is_said():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    boxes = [list(vars(box_of(image)).values()) for image in images]
    assert on_object()(*images, pair, surface=COARSE).doubts == []

    pose = pair.right.camera_from_left.copy()
    pose[:3, 3] *= 25  # squares of a chessboard for metres
    huge = RealPair(pair.left, replace(pair.right, camera_from_left=pose))
    said = on_object()(*images, huge, surface=COARSE).doubts
    assert [line.split(" in the model's")[0] for line in said] == [
        "the cameras are 2 m apart,",
        "the object is 14.9 m away,",
        "the object has a size of 3.53 m,",
    ]

    apart = [
        [left, top + 15 * side, right, bottom + 15 * side]
        for side, (left, top, right, bottom) in enumerate(boxes)
    ]
    (line,) = on_object()(*images, pair, boxes=apart, surface=COARSE).doubts
    assert line.startswith("the object's rows differ by 20 % of its height")

    cut = np.full_like(images[0], 255)
    shift = int(boxes[0][0] + 0.5) + 20
    cut[:, : W - shift] = images[0][:, shift:]
    cut_pair = RealPair(
        replace(pair.left, K=pair.left.K - np.array([[0, 0, shift], [0, 0, 0], [0, 0, 0]])), pair.right
    )
    assert (
        "the object reaches the edge of the left image: what is beyond is not seen"
        in on_object()(cut, images[1], cut_pair, surface=COARSE).doubts
    )


def test_python_takes_arrays_and_pillows_images():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    masks = tuple(image.min(axis=2) < 128 for image in images)
    plain_ = on_object()(*images, pair, masks=masks, surface=COARSE)
    floats = tuple(mask.astype(float) for mask in masks)
    for given in (
        on_object()(*map(Image.fromarray, images), pair, masks=masks, surface=COARSE),
        on_object()(*images, pair, masks=floats, surface=COARSE),
    ):
        np.testing.assert_array_equal(given.mesh.vertices, plain_.mesh.vertices)
    one, other = (
        on_object()(*images, pair, center=center, size=0.16, surface=COARSE)
        for center in (CENTER, CENTER.tolist())
    )
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)


@pytest.mark.parametrize("name", PAIRS)
def test_the_mirror_image_of_a_pair_says_the_same_of_the_same_place(name):
    """Silhouettes know no side, so asking about the mirror image as well changes nothing."""
    pair = PAIRS[name]
    images = [photograph(camera, center=np.array([0.07, 0.02, 0.5])) for camera in pair.cameras]
    alone, both = (
        on_object()(*images, pair, mirror=mirror, surface=SurfaceOptions(resolution=48))
        for mirror in (False, True)
    )
    np.testing.assert_allclose(both.mesh.bounds, alone.mesh.bounds, atol=2e-4)
    assert both.mesh.volume == pytest.approx(alone.mesh.volume, rel=0.01)


def test_what_a_model_says_of_a_side_is_taken_back_by_the_mirror_image():
    asked = []

    def leaning(views):
        asked.append(views)
        return lambda points_N3: 10 * points_N3[:, 0] + points_N3[:, 1]

    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    model = Reconstructor(training("rig=rectified", "placement=free"), leaning, Decision(0.5), "leaning")
    mesh = model(*images, pair, mirror=True, surface=COARSE).mesh_in_rig()
    assert mesh.bounds[0, 1] == pytest.approx(0, abs=1e-3)  # what is left: above the middle
    assert mesh.bounds[:, 0].sum() == pytest.approx(0, abs=1e-3)
    own, other = asked
    torch.testing.assert_close(other.left_BCHW, own.right_BCHW.flip(-1))
    assert other.camera_from_rig_B244[0, 0, 0, 3] == pytest.approx(-own.camera_from_rig_B244[0, 1, 0, 3])


@pytest.mark.parametrize(("share", "times"), [(0.0, 1), (0.5, 2)])
def test_the_mirror_image_is_asked_about_where_training_had_some(share, times):
    asked = []
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    config = training("rig=rectified", "placement=free", f"augmentation.mirror={share}")
    model = Reconstructor(config, lambda views: asked.append(views) or silhouettes(views), Decision(0.5), "")
    model(*images, pair, surface=COARSE)
    assert len(asked) == times


def test_the_rig_frame_stands_upright_at_the_cube():
    pair = PAIRS["parallel"]
    result = on_object()(*map(photograph, pair.cameras), pair, surface=COARSE)
    np.testing.assert_allclose(middle(result.mesh_in_rig())[:2], 0, atol=0.003)
    rotation = result.left_from_rig[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert rotation[1, 1] < -0.9  # up in the rig is against the camera's down
    assert result.left_from_rig[2, 3] == pytest.approx(CENTER[2], abs=0.01)


def toed_in_pair(distance=0.5, half_angle_deg=11.25):
    """The paper's arrangement, at another size, seen by a wider and a higher image."""
    K = np.array([[300.0, 0, (W - 1) / 2], [0, 300, (H - 1) / 2], [0, 0, 1]])
    poses = []
    for angle in np.radians([-half_angle_deg, half_angle_deg]):
        c, s = np.cos(angle), np.sin(angle)
        poses.append(np.array([[c, 0, -s, 0], [0, -1, 0, 0], [-s, 0, -c, distance], [0, 0, 0, 1]]))
    relative = poses[1] @ np.linalg.inv(poses[0])
    lens = Lens.from_list([])
    return RealPair(RealCamera(K, lens, np.eye(4), (W, H)), RealCamera(K, lens, relative, (W, H)))


def test_a_checkpoint_of_the_papers_rig_takes_the_whole_view_about_the_fixation_point():
    pair = toed_in_pair()
    where = np.array([0.02, -0.03, 0.5])
    images = [photograph(camera, where, 0.1) for camera in pair.cameras]
    result = reconstructor("rig=paper")(*images, pair, surface=COARSE)
    assert result.unit == pytest.approx(0.5)  # cameras at 0.5 m, in training at 1 m
    np.testing.assert_allclose(result.left_from_cube[:3, 3], [0, 0, 0.5], atol=1e-9)
    np.testing.assert_allclose(
        result.framing.rig.left.center, [-np.sin(np.pi / 16), 0, np.cos(np.pi / 16)], atol=1e-9
    )
    np.testing.assert_allclose(middle(result.mesh), where, atol=0.02)


@pytest.mark.parametrize(
    ("pair", "complaint"),
    [
        (toed_in_pair(half_angle_deg=4), "meet at 8.0 degrees, .* in training at 22.5 to 22.5 degrees"),
        (PAIRS["parallel"], "optical axes do not meet.*use one trained with rig=rectified"),
    ],
)
def test_another_arrangement_than_the_papers_is_refused(pair, complaint):
    images = [photograph(camera) for camera in pair.cameras]
    with pytest.raises(UserError, match=complaint):
        reconstructor("rig=paper")(*images, pair, surface=COARSE)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (
            {"boxes": ([10, 10, 20, 20], None)},
            "right: nothing in it looks like .* left image; .* give right_box=",
        ),
        ({"boxes": ([300, 100, 300.4, 100.4], None)}, "right: nothing in it looks like"),
        ({"boxes": ([10, 100, 600, 102.5], None)}, "right: nothing in it looks like"),
        ({"boxes": ([10, 10, 5, 20],) * 2}, "left_box=.*must have left < right"),
        ({"boxes": ([10, 10, 700, 20],) * 2}, "left_box=.*reaches out of the image of 640 x 360 pixels"),
        ({"boxes": ([10, 10, 20],) * 2}, "must be \\[left,top,right,bottom\\]"),
        ({"masks": (np.zeros((H, W), bool),) * 2}, "left_mask: must have the image's size and true pixels"),
        ({"center": [0, 0, -1], "size": 0.1}, "must be in front of the cameras"),
        ({"center": [0, 0], "size": 0.1}, "must be \\[x,y,z\\] in metres"),
        ({"boxes": ([10, 10, 20, 20],)}, "boxes: must be \\(left, right\\), None for what is not known"),
        ({"masks": None}, "masks: must be \\(left, right\\)"),
        ({"size": -1.0}, "size=-1.0: must be metres above 0"),
        ({"boxes": ([300, 100, 340, 140], [400, 100, 440, 140])}, "left and right not swapped"),
        ({"surface": replace(COARSE, threshold=0.9999999)}, "nothing is occupied at a probability of 1"),
    ],
)
def test_mistakes_are_one_line(options, complaint):
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    with pytest.raises(UserError, match=complaint) as raised:
        on_object()(*images, pair, **{"surface": COARSE} | options)
    assert "\n" not in str(raised.value)


def test_a_background_that_is_not_plain_needs_a_box():
    pair = PAIRS["parallel"]
    noise = np.random.default_rng(0).integers(256, size=(H, W, 3), dtype=np.uint8)
    with pytest.raises(UserError, match=r"left: its background is not plain.*give left_box="):
        on_object()(noise, noise, pair, surface=COARSE)


def test_an_empty_scene_has_no_object():
    white = np.full((H, W, 3), 255, np.uint8)
    with pytest.raises(UserError, match="covers 0 % of it: no object; give left_box="):
        on_object()(white, white, PAIRS["parallel"], surface=COARSE)


def test_a_checkpoint_without_backgrounds_wants_masks():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    masked = reconstructor("rig=rectified", "placement=free", "background=masked")
    with pytest.raises(UserError, match="trained on pictures without a background: give left_mask="):
        masked(*images, pair, boxes=([300, 150, 420, 270], [250, 150, 370, 270]), surface=COARSE)


def test_the_preview_draws_the_outline_around_the_object():
    pair = PAIRS["both"]
    images = [photograph(camera) for camera in pair.cameras]
    result = on_object()(*images, pair, surface=SurfaceOptions(resolution=64))
    picture = result.preview()
    line = (picture == (255, 0, 170)).all(axis=2)
    for index, image in enumerate(images):
        panel = line[:270, 480 * index : 480 * (index + 1)]
        dark = np.asarray(Image.fromarray(image).resize((480, 270))).mean(axis=2) < 170
        v, u = np.nonzero(panel)
        v_dark, u_dark = np.nonzero(dark)
        for line_ends, object_ends in ((v, v_dark), (u, u_dark)):
            assert abs(line_ends.min() - object_ends.min()) <= 4
            assert abs(line_ends.max() - object_ends.max()) <= 4


def test_colours_come_from_the_photographs():
    pair = PAIRS["parallel"]
    images = [photograph(camera) for camera in pair.cameras]
    result = on_object()(*images, pair, surface=replace(COARSE, color=True))
    colors_V3 = np.asarray(result.mesh.visual.vertex_colors)[:, :3]
    near = np.abs(colors_V3.astype(int) - [60, 80, 100]).max(axis=1) < 30
    assert near.mean() > 0.95


def test_the_description_is_of_the_mesh():
    pair = PAIRS["parallel"]
    result = on_object()(*map(photograph, pair.cameras), pair, surface=COARSE)
    said = result.description()
    assert said["volume"] == pytest.approx(result.mesh.volume)
    assert said["watertight"] is True
    assert said["baseline"] == pytest.approx(0.08)
    assert 0 < said["confidence"] <= 1
    np.testing.assert_allclose(said["center"], middle(result.mesh))
