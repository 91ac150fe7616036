"""Lenses, calibration files of every kind, and what is said of wrong ones."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from samples import single_line
from scipy.spatial.transform import Rotation

from stereo_occ.calibration import Lens, RealCamera, RealPair, read_calibration
from stereo_occ.errors import UserError

K1 = np.array([[700.0, 0, 470], [0, 702, 260], [0, 0, 1]])
K2 = np.array([[690.0, 0, 490], [0, 693, 275], [0, 0, 1]])
D1, D2 = [-0.2, 0.05, 0.001, -0.002, 0.01], [-0.18, 0.04, 0.0, 0.001, 0.0]
R = Rotation.from_euler("XYZ", [0.5, -3, 1], degrees=True).as_matrix()
T = -R @ [0.06, 0.001, -0.002]
POINTS_N2 = np.array([[0.1, -0.2], [0.4, 0.3], [-0.5, 0.1]])

# What cv2.FileStorage writes.
OPENCV_YAML = """%YAML:1.0
---
image_width: 960
image_height: 540
K1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 700., 0., 470., 0., 702., 260., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.0000000000000001e-01, 5.0000000000000003e-02, 1e-03, -2e-3,
       1.0e-02 ]
K2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 690., 0., 490., 0., 693., 275., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.18, 0.04, 0., 1.0e-03, 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {R}
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: {T}
"""


def opencv(**changes):
    values = {
        "image_width": 960,
        "image_height": 540,
        "K1": K1.tolist(),
        "D1": D1,
        "K2": K2.tolist(),
        "D2": D2,
    }
    values |= {"R": R.tolist(), "T": T.tolist()}
    return {key: value for key, value in (values | changes).items() if value is not None}


def write(path, values):
    path.write_text(yaml.safe_dump(values) if path.suffix == ".yaml" else json.dumps(values))
    return path


def matrix(values, rows):
    data = np.asarray(values, dtype=float).ravel().tolist()
    return {"rows": rows, "cols": len(data) // rows, "data": data}


def camera_info(K, D, R_rect, P, model="plumb_bob"):
    return {
        "image_width": 960, "image_height": 540, "camera_name": "cam", "camera_matrix": matrix(K, 3),
        "distortion_model": model, "distortion_coefficients": matrix(D, 1),
        "rectification_matrix": matrix(R_rect, 3), "projection_matrix": matrix(P, 3),
    }  # fmt: skip


def ros_pair():
    """The rectification that turns both cameras to have their x along the baseline."""
    x = R.T @ -T / np.linalg.norm(T)
    y = np.cross(np.array([0, 0, 1]) + R[2], x)
    y /= np.linalg.norm(y)
    R1 = np.stack([x, y, np.cross(x, y)])
    P1 = np.array([[650.0, 0, 480, 0], [0, 650, 270, 0], [0, 0, 1, 0]])
    P2 = P1.copy()
    P2[0, 3] = -650 * np.linalg.norm(T)
    return camera_info(K1, D1, R1, P1), camera_info(K2, D2, R1 @ R.T, P2)


def own(unit="m", metres=1.0):
    """In a rig frame of its own."""
    left_from_rig = np.eye(4)
    left_from_rig[:3, :3] = Rotation.from_euler("XYZ", [10, 20, 30], degrees=True).as_matrix()
    left_from_rig[:3, 3] = [1, 2, 3]
    right_from_left = np.eye(4)
    right_from_left[:3, :3], right_from_left[:3, 3] = R, T
    parts = {}
    for name, K, D, pose in (
        ("left", K1, D1, left_from_rig),
        ("right", K2, D2, right_from_left @ left_from_rig),
    ):
        pose = pose.copy()
        pose[:3, 3] /= metres
        parts[name] = {
            "width": 960, "height": 540, "K": K.tolist(), "distortion": D, "camera_from_rig": pose.tolist(),
        }  # fmt: skip
    return {"unit": unit, **parts}


def files(kind, folder):
    if kind == "opencv yaml":
        path = folder / "stereo.yml"
        path.write_text(OPENCV_YAML.replace("{R}", str(R.ravel().tolist())).replace("{T}", str(T.tolist())))
        return path
    if kind == "opencv json":
        values = opencv()
        for key, rows in (("K1", 3), ("K2", 3), ("R", 3), ("T", 3)):
            values[key] = {"type_id": "opencv-matrix", "dt": "d", **matrix(values[key], rows)}
        return write(folder / "stereo.json", values)
    if kind == "opencv two files":
        values = opencv()
        extrinsics = {key: values.pop(key) for key in ("R", "T")}
        for new, old in (("M1", "K1"), ("M2", "K2")):
            values[new] = values.pop(old)
        return [write(folder / "intrinsics.yaml", values), write(folder / "extrinsics.yaml", extrinsics)]
    if kind == "ros":
        left, right = ros_pair()
        files = [write(folder / "left.yaml", left), write(folder / "right.yaml", right)]
        files[0].write_text(files[0].read_text() + "---\n")  # as "ros2 topic echo --once" ends
        return files
    return write(folder / "own.yaml", own(*(("mm", 0.001) if kind == "own in mm" else ())))


@pytest.mark.parametrize(
    "kind", ["opencv yaml", "opencv json", "opencv two files", "ros", "own", "own in mm"]
)
def test_every_kind_of_file_says_the_same(kind, tmp_path):
    pair = read_calibration(files(kind, tmp_path))
    for camera, K, D in ((pair.left, K1, D1), (pair.right, K2, D2)):
        np.testing.assert_allclose(camera.K, K)
        np.testing.assert_allclose(camera.lens.coefficients, D)
        assert camera.size == (960, 540)
    np.testing.assert_allclose(pair.left.camera_from_left, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(pair.right.camera_from_left[:3, :3], R, atol=1e-9)
    np.testing.assert_allclose(pair.right.camera_from_left[:3, 3], T, atol=1e-9)
    assert pair.baseline == pytest.approx(np.linalg.norm(T))


@pytest.mark.parametrize("kind", ["opencv", "ros"])
def test_rectified_images_have_the_projections_cameras(kind, tmp_path):
    left, right = ros_pair()
    if kind == "ros":
        paths = [write(tmp_path / "l.yaml", left), write(tmp_path / "r.yaml", right)]
    else:
        projections = {
            key: np.reshape(info["projection_matrix"]["data"], (3, 4)).tolist()
            for key, info in (("P1", left), ("P2", right))
        }
        paths = write(tmp_path / "p.json", opencv(**projections))
    pair = read_calibration(paths, rectified=True)
    assert pair.left.lens.ideal
    assert pair.right.lens.ideal
    np.testing.assert_allclose(pair.right.K, [[650, 0, 480], [0, 650, 270], [0, 0, 1]])
    np.testing.assert_allclose(pair.right.center_3, [np.linalg.norm(T), 0, 0], atol=1e-12)


def test_units(tmp_path):
    path = write(tmp_path / "mm.json", opencv(T=(1000 * T).tolist()))
    assert read_calibration(path, unit="mm").baseline == pytest.approx(np.linalg.norm(T))
    squares = write(tmp_path / "squares.json", opencv(T=(T / 0.025).tolist()))
    assert read_calibration(squares, unit=0.025).baseline == pytest.approx(np.linalg.norm(T))


@pytest.mark.parametrize(
    ("changes", "options", "complaint"),
    [
        (
            {"T": (1000 * T).tolist()},
            {},
            "apart, expected 0.005 to 3.0 m; are its lengths in mm\\? set unit=mm",
        ),
        ({"T": (100 * T).tolist()}, {}, "are its lengths in cm or in\\? set unit=cm"),
        ({"T": (T / 1000).tolist()}, {}, "expected 0.005 to 3.0 m; set unit=$"),
        ({"T": (-T).tolist()}, {}, "left camera is right of the right one.*swap left and right"),
        ({"T": [0, -0.06, 0], "R": np.eye(3).tolist()}, {}, "must be side by side"),
        ({"R": (1.1 * R).tolist()}, {}, "R and T of the right camera.*must be a rotation"),
        ({"R": np.diag([1, 1, -1]).tolist()}, {}, "must be a rotation"),
        ({"R": [1, 2]}, {}, "R must be 3 x 3 numbers"),
        ({"R": None}, {}, "has no key R"),
        ({"K2": None}, {}, "has no key K2 or M2"),
        ({"K1": np.zeros((3, 3)).tolist()}, {}, "positive focal lengths"),
        ({"D1": [0.1, 0.2, 0.3]}, {}, "takes 0 or 4 or 5 or 8 or 12 or 14 coefficients, got 3"),
        ({"D1": "none"}, {}, "D1 must be numbers"),
        ({"image_width": 0}, {}, "image size must be positive"),
        ({}, {"unit": "feet"}, "unit=feet: must be one of m, cm, mm, in"),
        ({}, {"rectified": True}, "has no key P1"),
    ],
)
def test_mistakes_are_one_line(changes, options, complaint, tmp_path):
    path = write(tmp_path / "stereo.json", opencv(**changes))
    with pytest.raises(UserError, match=complaint) as raised:
        read_calibration(path, **options)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: [1, 2", "neither YAML nor JSON, line"),
        ("just words", "holds no keys"),
        ("", "holds no keys"),
        ("x: !!python/object/apply:os.system [true]", "neither YAML nor JSON"),
        ("fx: 700\nfy: 700", "is no known calibration; .* found fx, fy"),
    ],
)
def test_no_calibrations(text, complaint, tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(UserError, match=complaint) as raised:
        read_calibration(path)
    assert single_line(str(raised.value))


def test_one_camera_info_is_half_a_pair(tmp_path):
    with pytest.raises(UserError, match="of one camera; give both, left first"):
        read_calibration(write(tmp_path / "left.yaml", ros_pair()[0]))


def test_binary_and_missing_files(tmp_path):
    (tmp_path / "x.yaml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(UserError, match="cannot be read \\(not text\\)"):
        read_calibration(tmp_path / "x.yaml")
    with pytest.raises(UserError, match="No such file"):
        read_calibration(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("coefficients", "fisheye", "first", "last"),
    [  # computed with OpenCV 5.0's projectPoints
        (D1, False, [0.098832625, -0.19781525], [-0.47739788, 0.095635576]),
        ([*D1, 0.1, 0.02, -0.01], False, [0.0983352462, -0.1968204923], [-0.4648101143, 0.0931180229]),
        (
            [*D1, 0.1, 0.02, -0.01, 0.003, -0.001, 0.002, 0.004],
            False,
            [0.0984827462, -0.1967104923],
            [-0.4640977143, 0.0939084229],
        ),
        ([0.1, -0.02, 0.003, -0.001], True, [0.0988531539, -0.1977063079], [-0.4722186773, 0.0944437355]),
    ],
)
def test_lenses_are_opencvs_and_invertible(coefficients, fisheye, first, last):
    lens = Lens.from_list(coefficients, fisheye)
    distorted_N2 = lens.distort(POINTS_N2)
    np.testing.assert_allclose(distorted_N2[[0, 2]], [first, last], atol=1e-9)
    np.testing.assert_allclose(lens.undistort(distorted_N2), POINTS_N2, atol=1e-8)


@pytest.mark.parametrize(
    ("coefficients", "fisheye", "point"),
    [([-5.0, 0, 0, 0, 0], False, (0.9, 0.9)), ([0.0] * 4, True, (1.7, 0.0)), ([0.0] * 4, True, (40.0, 40.0))],
)
def test_where_a_lens_shows_nothing_it_says_so(coefficients, fisheye, point):
    """Beyond where it folds the image; beyond 90 degrees from the axis."""
    with pytest.raises(UserError, match="cannot be removed"):
        Lens.from_list(coefficients, fisheye).undistort(np.array([point]))


def test_scaled_images_scale_the_cameras():
    pair = read_pair()
    half = pair.fitted(((480, 270), (480, 270)))
    points_N3 = np.array([[0.1, 0.05, 0.6], [-0.2, 0.1, 1.0]])
    for whole, small in zip(pair.cameras, half.cameras, strict=True):
        np.testing.assert_allclose((whole.pixels(points_N3) + 0.5) / 2 - 0.5, small.pixels(points_N3))


def read_pair(**changes):
    values = opencv(**changes)
    size = (values["image_width"], values["image_height"]) if "image_width" in values else None
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R, T
    return RealPair(
        RealCamera(K1, Lens.from_list(D1), np.eye(4), size), RealCamera(K2, Lens.from_list(D2), pose, size)
    )


@pytest.mark.parametrize(
    ("sizes", "changes", "complaint"),
    [
        (
            ((640, 480),) * 2,
            {},
            "calibrated with 960 x 540 pixels, its image has 640 x 480, .* not the same shape",
        ),
        (((320, 180),) * 2, {"image_width": None}, "principal point of the left camera is at \\(470, 260\\)"),
        (((960, 540), (480, 270)), {"image_width": None}, "they must have one size"),
    ],
)
def test_images_of_another_size(sizes, changes, complaint):
    with pytest.raises(UserError, match=complaint):
        read_pair(**changes).fitted(sizes)


def test_a_part_cut_out_far_from_the_axis_is_an_image_of_its_own(tmp_path):
    """The last 200 x 200 pixels of a wide image: the axis is 1.4 widths left of them."""
    values = own()
    for name in ("left", "right"):
        K = np.array(values[name]["K"])
        K[:2, 2] -= [760, 340]
        values[name] |= {"K": K.tolist(), "width": 200, "height": 200}
    pair = read_calibration(write(tmp_path / "cut.yaml", values)).fitted(((200, 200),) * 2)
    whole = read_calibration(write(tmp_path / "own.yaml", own()))
    points_N3 = np.array([[0.3, 0.15, 0.8]])
    np.testing.assert_allclose(pair.left.pixels(points_N3), whole.left.pixels(points_N3) - [760, 340])


def test_our_own_file_of_unrectified_cameras_is_not_of_rectified_images(tmp_path):
    path = write(tmp_path / "own.yaml", own())
    assert read_calibration(path).left.lens.coefficients.any()
    with pytest.raises(UserError, match="rectified=true, but it describes cameras with distortion or turned"):
        read_calibration(path, rectified=True)
    values = own()
    values["right"]["camera_from_rig"] = (np.array(values["left"]["camera_from_rig"])).tolist()
    values["right"]["camera_from_rig"][0][3] -= 0.06
    for name in ("left", "right"):
        del values[name]["distortion"]
    assert read_calibration(write(path, values), rectified=True).baseline == pytest.approx(0.06)


def test_rays_lead_back_to_their_pixels():
    for camera in read_pair().cameras:
        pixels_N2 = np.random.default_rng(0).uniform([0, 0], [960, 540], (50, 2))
        np.testing.assert_allclose(camera.pixels_along(camera.rays(pixels_N2)), pixels_N2, atol=1e-5)


def test_a_rectified_pair_sees_every_point_on_one_row():
    rig = read_pair().rectified()
    points_N3 = np.random.default_rng(0).uniform([-0.3, -0.2, 0.4], [0.3, 0.2, 1.5], (50, 3))
    (left_N2, depth_N), (right_N2, right_depth_N) = (camera.project(points_N3) for camera in rig.cameras)
    np.testing.assert_allclose(left_N2[:, 1], right_N2[:, 1], atol=1e-9)
    np.testing.assert_allclose(depth_N, right_depth_N)
    focal = rig.left.K[0, 0]
    np.testing.assert_allclose(left_N2[:, 0] - right_N2[:, 0], focal * rig.baseline / depth_N)
    assert rig.baseline == pytest.approx(np.linalg.norm(T))


def test_rectifying_a_parallel_pair_does_not_turn_it():
    pose = np.eye(4)
    pose[0, 3] = -0.06
    camera = read_pair().left
    rig = RealPair(camera, replace(camera, camera_from_left=pose)).rectified()
    np.testing.assert_allclose(rig.left.camera_from_rig, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(rig.right.camera_from_rig, pose, atol=1e-12)
