"""A calibrated pair of real cameras: pinhole, lens and place of each, in the left camera's frame."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stereo_occ.calibration.lens import Lens
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import (
    Camera,
    StereoRig,
    centered_intrinsics,
    check_rigid,
    resized_intrinsics,
)

#: Baselines that a pair of cameras for household objects may have, metres.
BASELINES = (0.005, 3.0)

#: Baselines among which a unit is looked for that its file may have forgotten, metres.
LIKELY = (0.02, 0.5)

#: Metres per unit.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}

#: Between the optical axes, degrees: more than this sees no household object from both sides.
MOST_APART = 90.0

#: Focal lengths that a camera may have, in widths of its images: views of 170 degrees to half a degree.
FOCAL_LENGTHS = (0.04, 100.0)

#: Widths and heights of an image may differ by this share from the calibration's, as a rounded division does.
SAME_SHAPE = 0.01


@dataclass(frozen=True, eq=False)
class RealCamera:
    """A camera that takes photographs.

    Attributes:
        K: intrinsics ``(3, 3)``, pixels.
        lens: its distortion.
        camera_from_left: ``(4, 4)`` rigid, metres.
        size: width and height of its images in pixels; None where the calibration does not say.
    """

    K: NDArray[np.float64]
    lens: Lens
    camera_from_left: NDArray[np.float64]
    size: tuple[int, int] | None

    @property
    def rotation_33(self) -> NDArray[np.float64]:
        """Of ``camera_from_left``."""
        return self.camera_from_left[:3, :3]

    @property
    def center_3(self) -> NDArray[np.float64]:
        """Optical centre, left camera's frame, metres."""
        return -self.rotation_33.T @ self.camera_from_left[:3, 3]

    def pixels(self, points_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points ``(N, 3)`` of the left camera's frame appear in a photograph ``(N, 2)``."""
        local_N3 = points_N3 @ self.rotation_33.T + self.camera_from_left[:3, 3]
        return self.pixels_along(local_N3)

    def pixels_along(self, rays_N3: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where rays ``(N, 3)`` of the camera's own frame appear ``(N, 2)``."""
        flat_N2 = rays_N3[:, :2] / np.maximum(rays_N3[:, 2:], 1e-9)
        return np.asarray(self.lens.distort(flat_N2) @ self.K[:2, :2].T + self.K[:2, 2])

    def rays(self, pixels_N2: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rays ``(N, 3)`` with ``z = 1`` in the camera's own frame through pixels of a photograph."""
        flat_N2 = (pixels_N2 - self.K[:2, 2]) @ np.linalg.inv(self.K[:2, :2]).T
        ideal_N2 = self.lens.undistort(flat_N2)
        return np.concatenate([ideal_N2, np.ones_like(ideal_N2[:, :1])], axis=1)

    def fitted(self, width: int, height: int, name: str) -> "RealCamera":
        """The camera for images of another size, of the same shape.

        Raises:
            UserError: if they are of another shape, or focal length or principal point say that the size is not theirs.
        """
        # A part cut out of an image may have it far outside.
        low, high = (0.25, 0.75) if self.size is None else (-4, 5)
        center_2 = (self.K[:2, 2] + 0.5) / (self.size or (width, height))
        if not ((center_2 > low) & (center_2 < high)).all():
            where = f"the principal point of the {name} camera is at ({self.K[0, 2]:.0f}, {self.K[1, 2]:.0f})"
            if self.size is not None:
                raise UserError(
                    f"rig: {where}, far out of its images of {self.size[0]} x {self.size[1]} pixels; check K"
                )
            raise UserError(
                f"rig: {where}, but its image has {width} x {height} pixels; "
                f"if it was calibrated at another size, add image_width and image_height to the file"
            )
        across = max(self.size or (width, height))
        for focal in (self.K[0, 0], self.K[1, 1]):
            if not FOCAL_LENGTHS[0] <= focal / across <= FOCAL_LENGTHS[1]:
                raise UserError(
                    f"rig: the {name} camera has a focal length of {focal:g} pixels, which is no lens's for images of "
                    f"{across} pixels; check K: its lengths are in pixels"
                )
        if self.size is None:
            return replace(self, size=(width, height))
        scale_2 = np.array([width, height]) / self.size
        if abs(scale_2[0] / scale_2[1] - 1) > SAME_SHAPE:
            raise UserError(
                f"rig: the {name} camera was calibrated with {self.size[0]} x {self.size[1]} pixels, its image has "
                f"{width} x {height}, which is not the same shape; calibrate at the size of the image, or scale it back"
            )
        K = resized_intrinsics(self.K, self.size, (width, height))
        return replace(self, K=K, size=(width, height))


@dataclass(frozen=True, eq=False)
class RealPair:
    """Left and right; the left camera's frame: OpenCV's axes, +X right, +Y down, +Z forward, metres.

    Raises:
        UserError: if this is no pair of cameras beside each other, the left one left.
    """

    left: RealCamera
    right: RealCamera

    def __post_init__(self) -> None:
        for name, camera in (("left", self.left), ("right", self.right)):
            _check_intrinsics(camera.K, name)
            check_rigid(camera.camera_from_left, f"rig: R and T of the {name} camera")
        angle = np.degrees(np.arccos(np.clip(self.left.rotation_33[2] @ self.right.rotation_33[2], -1, 1)))
        if angle > MOST_APART:
            raise UserError(
                f"rig: the cameras look {angle:.0f} degrees apart, expected at most {MOST_APART:.0f}; "
                f"check R: it must turn the left camera's axes to the right one's"
            )
        baseline = self.baseline
        if not BASELINES[0] <= baseline <= BASELINES[1]:
            likely = [name for name, metres in UNITS.items() if LIKELY[0] <= metres * baseline <= LIKELY[1]]
            hint = f"are its lengths in {' or '.join(likely)}? " if baseline > BASELINES[1] and likely else ""
            raise UserError(
                f"rig: the cameras are {baseline:.6g} m apart, expected {BASELINES[0]} to {BASELINES[1]} m; "
                f"{hint}set unit={likely[0] if hint else ''}"
            )
        x, y, z = self.baseline_direction
        if abs(x) < max(abs(y), abs(z)):
            raise UserError(
                f"rig: the cameras must be side by side, but the way from left to right in their images is "
                f"({x:.2f}, {y:.2f}, {z:.2f}), right, down, forward; turn images of cameras above one another"
            )
        if x < 0:
            raise UserError(
                "rig: the left camera is right of the right one (T points the other way: OpenCV's is negative in x); "
                "swap left and right, in images and calibration alike"
            )

    @property
    def cameras(self) -> tuple[RealCamera, RealCamera]:
        """Left, right."""
        return self.left, self.right

    @property
    def baseline(self) -> float:
        """Metres between the optical centres."""
        return float(np.linalg.norm(self.right.center_3 - self.left.center_3))

    @property
    def parallel(self) -> bool:
        """Whether the cameras' axes are, to a hundredth of a degree."""
        return bool(np.allclose(self.left.rotation_33, self.right.rotation_33, atol=2e-4))

    @property
    def baseline_direction(self) -> NDArray[np.float64]:
        """From left to right ``(3,)``, along the mean of both cameras' axes: right, down, forward."""
        between_3 = (self.right.center_3 - self.left.center_3) / self.baseline
        axes_33 = self.left.rotation_33 + self.right.rotation_33
        axes_33 = axes_33 / np.linalg.norm(axes_33, axis=1, keepdims=True)
        return np.asarray(axes_33 @ between_3)

    def fitted(self, sizes: tuple[tuple[int, int], tuple[int, int]]) -> "RealPair":
        """The pair for images of these widths and heights; see :meth:`RealCamera.fitted`."""
        if sizes[0] != sizes[1] and None in (self.left.size, self.right.size):
            raise UserError(
                f"left, right: have {sizes[0][0]} x {sizes[0][1]} and {sizes[1][0]} x {sizes[1][1]} pixels; they must "
                f"have one size, unless the calibration gives each camera's"
            )
        left, right = (
            camera.fitted(*size, name)
            for camera, size, name in zip(self.cameras, sizes, ("left", "right"), strict=True)
        )
        return RealPair(left, right)

    def pinholes(self) -> StereoRig:
        """The same cameras without their lenses' distortion; rig frame: the left camera's."""
        return StereoRig(*(Camera(c.K, c.camera_from_left, *_size(c)) for c in self.cameras))

    def rectified(self) -> StereoRig:
        """Parallel cameras at the same places, with one K, whose rows are the same: what the pair would see turned.

        Both have the left image's size. Rig frame: the left camera's as calibrated. Nothing changes for a pair that is
        rectified already.
        """
        x_3 = (self.right.center_3 - self.left.center_3) / self.baseline
        z_3 = self.left.rotation_33[2] + self.right.rotation_33[2]
        y_3 = np.cross(z_3, x_3)
        y_3 /= np.linalg.norm(y_3)
        R_33 = np.stack([x_3, y_3, np.cross(x_3, y_3)])
        focal = float(np.mean([camera.K[[0, 1], [0, 1]] for camera in self.cameras]))
        cameras = []
        width, height = _size(self.left)
        K = centered_intrinsics(focal, width, height)
        for camera in self.cameras:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = R_33, -R_33 @ camera.center_3
            cameras.append(Camera(K, pose, width, height))
        return StereoRig(*cameras)


def _check_intrinsics(K: NDArray[np.float64], name: str) -> None:
    sound = K.shape == (3, 3) and bool(np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0)
    if sound and np.array_equal(K[2], [0, 0, 1]):
        return
    hint = "; is it transposed?" if sound and np.array_equal(K[:, 2], [0, 0, 1]) else ""
    raise UserError(
        f"rig: K of the {name} camera must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with positive focal lengths, "
        f"got {K.tolist()}{hint}"
    )


def _size(camera: RealCamera) -> tuple[int, int]:
    assert camera.size is not None, "fit the pair to its images first"
    return camera.size
