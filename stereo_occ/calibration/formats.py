"""Three kinds of calibration file, each to the pair that it describes."""

import numpy as np
from numpy.typing import NDArray

from stereo_occ.calibration.fields import Fields
from stereo_occ.calibration.lens import Lens
from stereo_occ.calibration.pair import RealCamera, RealPair
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import check_rigid

#: Names that are in use for the matrices of ``cv2.stereoCalibrate``, left camera's 1 and right camera's 2.
INTRINSICS = ("K{}", "M{}", "cameraMatrix{}", "camera_matrix_{}", "camera_matrix{}", "mtx{}")
DISTORTION = ("D{}", "distCoeffs{}", "dist_coeffs_{}", "dist_coeffs{}", "dist{}")

#: ROS's names of distortion models; those of the first have no other meaning than OpenCV's.
ROS_MODELS = {"plumb_bob": False, "rational_polynomial": False, "": False, "none": False}
ROS_MODELS |= {"equidistant": True, "fisheye": True}

#: YAML's own words, and OpenCV's, whose files know numbers alone.
YES_OR_NO = {"true": True, "1": True, "false": False, "0": False}

IDEAL = Lens(np.zeros(0))


def from_opencv(fields: Fields, metres: float, rectified: bool) -> RealPair:
    """Of ``cv2.stereoCalibrate``: K1, D1, K2, D2, R, T; or of ``cv2.stereoRectify``: P1, P2, for rectified images.

    Args:
        metres: per unit of T.
        rectified: whether the images are those that ``cv2.stereoRectify`` leads to.

    Raises:
        UserError: keys are missing or no such matrices.
    """
    if rectified:
        return _from_projections(
            fields.array("P1", shape=(3, 4)), fields.array("P2", shape=(3, 4)), (fields.size(),) * 2, metres
        )
    fisheye = fields.text("fisheye", "false").lower()
    if fisheye not in YES_OR_NO:
        raise UserError(f"rig={fields.source}: fisheye must be true or false, got {fisheye!r}")
    right_from_left = np.eye(4)
    right_from_left[:3, :3] = fields.array("R", shape=(3, 3))
    right_from_left[:3, 3] = metres * fields.array("T", shape=(3,))
    cameras = []
    for index, pose in ((1, np.eye(4)), (2, right_from_left)):
        K = fields.array(*(name.format(index) for name in INTRINSICS), shape=(3, 3))
        distortion = fields.array(*(name.format(index) for name in DISTORTION))
        cameras.append(
            RealCamera(
                K, Lens.from_list(distortion.ravel().tolist(), YES_OR_NO[fisheye]), pose, fields.size()
            )
        )
    return RealPair(*cameras)


def from_ros(left: Fields, right: Fields, metres: float, rectified: bool) -> RealPair:
    """A pair of ``camera_info``: of the raw images, or of those that image_proc has rectified.

    ROS says where the cameras are by the rectification: both turn (rectification_matrix) to parallel axes, and the
    right projection_matrix holds ``-fx * baseline``.

    Raises:
        UserError: keys are missing, or the files are of single cameras.
    """
    projections = [f.array("projection_matrix", "P", "p", shape=(3, 4)) for f in (left, right)]
    if rectified:
        return _from_projections(projections[0], projections[1], (left.size(), right.size()), metres)
    poses = []
    for fields, P_34 in zip((left, right), projections, strict=True):
        _check_projection(P_34, f"rig={fields.source}: projection_matrix")
        pose = np.eye(4)
        pose[:3, :3] = fields.array("rectification_matrix", "R", "r", shape=(3, 3))
        pose[0, 3] = metres * P_34[0, 3] / P_34[0, 0]
        poses.append(pose)
    # A pose here leads from the camera to the common parallel axes, seen from that camera's own place.
    rigids = [_from_common(pose) for pose in poses]
    return _relative_to_left(
        [
            (f.array("camera_matrix", "K", "k", shape=(3, 3)), _ros_lens(f), rigid, f.size())
            for f, rigid in zip((left, right), rigids, strict=True)
        ]
    )


def from_own(fields: Fields, metres: float, rectified: bool) -> RealPair:
    """Our own: ``left`` and ``right``, each with width, height, K, camera_from_rig and perhaps distortion, model.

    Raises:
        UserError: keys are missing or no such matrices, or what they describe is not ``rectified`` though it should be.
    """
    parts = []
    for name in ("left", "right"):
        part = fields.part(name)
        pose = part.array("camera_from_rig", shape=(4, 4))
        pose[:3, 3] *= metres
        model = part.text("model", "plumb_bob")
        if model not in ROS_MODELS:
            raise UserError(f"rig={part.source}: model must be plumb_bob or fisheye, got {model}")
        distortion = part.array("distortion").ravel().tolist() if "distortion" in part else []
        lens = Lens.from_list(distortion, ROS_MODELS[model])
        parts.append((part.array("K", shape=(3, 3)), lens, pose, part.size()))
    pair = _relative_to_left(parts)
    if rectified and not (pair.left.lens.ideal and pair.right.lens.ideal and pair.parallel):
        raise UserError(
            f"rig={fields.source}: rectified=true, but it describes cameras with distortion or turned against each "
            f"other; give it the K of the rectified images, no distortion and no rotation, or leave rectified= out"
        )
    return pair


def _ros_lens(fields: Fields) -> Lens:
    model = fields.text("distortion_model", "plumb_bob")
    if model not in ROS_MODELS:
        raise UserError(
            f"rig={fields.source}: distortion_model must be one of {', '.join(filter(None, ROS_MODELS))}, got {model}"
        )
    return Lens.from_list(
        fields.array("distortion_coefficients", "D", "d").ravel().tolist(), ROS_MODELS[model]
    )


def _from_common(camera_to_common: NDArray[np.float64]) -> NDArray[np.float64]:
    """``camera_from_rig`` for a rig frame with the parallel axes at the left camera."""
    rigid = np.eye(4)
    rigid[:3, :3] = camera_to_common[:3, :3].T
    rigid[:3, 3] = camera_to_common[:3, :3].T @ camera_to_common[:3, 3]
    return rigid


def _from_projections(
    P1_34: NDArray[np.float64],
    P2_34: NDArray[np.float64],
    sizes: tuple[tuple[int, int] | None, tuple[int, int] | None],
    metres: float,
) -> RealPair:
    """Rectified images: P is ``K [I | t]``."""
    parts = []
    for name, P_34, size in zip(("left", "right"), (P1_34, P2_34), sizes, strict=True):
        _check_projection(P_34, f"rig: the projection of the {name} camera")
        pose = np.eye(4)
        pose[:3, 3] = metres * np.linalg.solve(P_34[:, :3], P_34[:, 3])
        parts.append((P_34[:, :3], IDEAL, pose, size))
    return _relative_to_left(parts)


def _check_projection(P_34: NDArray[np.float64], name: str) -> None:
    if not (
        np.isfinite(P_34).all() and P_34[0, 0] > 0 and P_34[1, 1] > 0 and P_34[2].tolist() == [0, 0, 1, 0]
    ):
        raise UserError(
            f"{name} must be [[fx, 0, cx, Tx], [0, fy, cy, Ty], [0, 0, 1, 0]] with positive focal lengths, "
            f"got {P_34.tolist()}"
        )


def _relative_to_left(
    parts: list[tuple[NDArray[np.float64], Lens, NDArray[np.float64], tuple[int, int] | None]],
) -> RealPair:
    check_rigid(parts[0][2], "rig: the pose of the left camera")
    rig_from_left = np.linalg.inv(parts[0][2])
    left, right = (RealCamera(K, lens, pose @ rig_from_left, size) for K, lens, pose, size in parts)
    return RealPair(left, right)
