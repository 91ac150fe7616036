"""Draw the rigs of conf/rig from their own geometry: ``make figures``."""

from math import degrees, radians, tan
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon, Rectangle
from numpy.typing import NDArray
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.data.rigs import RectifiedRigConfig, RigConfig, build_rig
from stereo_occ.geometry.camera import Camera, StereoRig

HERE = Path(__file__).parent
SIDE = 64  # pixels
LEFT, RIGHT, CUBE, FRAME = "tab:blue", "tab:orange", "0.35", "black"
COLORS = (LEFT, RIGHT)
CUBE_CORNERS_83 = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def rig_of(name: str) -> tuple[StereoRig, RigConfig]:
    """The cameras of a preset, in the middle of its ranges, and its settings."""
    config = OmegaConf.to_object(compose_config("render", [f"rig={name}"]).rig)
    assert isinstance(config, RigConfig)
    return build_rig(config, SIDE), config


def rays(camera: Camera, depth: float) -> NDArray[np.float64]:
    """Rig-frame points at ``depth`` behind the left and right edge of the middle row, ``(2, 3)``."""
    row = camera.project(np.zeros((1, 3)))[0][0, 1]
    return camera.unproject(np.array([[-0.5, row], [camera.width - 0.5, row]]), np.full(2, depth))


def arrow(axis: Axes, start: NDArray[np.float64], end: NDArray[np.float64], text: str, color: str) -> None:
    """An arrow with its name at the tip."""
    style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6}
    axis.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops=style)
    x, y = end + 0.3 * (end - start)
    axis.annotate(text, (x, y), color=color, ha="center", va="center", fontsize=9)


def camera_axes(axis: Axes, camera: Camera, length: float, unit: float, color: str, name: str) -> None:
    """A camera from above: +X right and +Z forward; +Y points down, away from the reader."""
    rig_from_camera_33 = camera.camera_from_rig[:3, :3].T
    center_2 = camera.center[[0, 2]] * unit
    for column, label in ((0, "x"), (2, "z")):
        arrow(axis, center_2, center_2 + length * rig_from_camera_33[[0, 2], column], label, color)
    axis.plot(*center_2, "o", color=color, markersize=9, markerfacecolor="white")
    axis.plot(*center_2, "x", color=color, markersize=5)
    side = -1 if center_2[0] < 0 else 1
    axis.annotate(
        name, center_2 + np.array([1.5 * side * length, 0.9 * length]), color=color, ha="center", fontsize=10
    )


def dimension(
    axis: Axes, start: tuple[float, float], end: tuple[float, float], text: str, drop: float
) -> None:
    """A length with its name below the middle."""
    axis.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": "0.3"})
    middle = (np.array(start) + end) / 2
    axis.annotate(text, middle + np.array([0, drop]), ha="center", va="center", fontsize=9, color="0.2")


def note(axis: Axes, text: str, place: tuple[float, float], text_at: tuple[float, float]) -> None:
    """A remark with a line to what it is about."""
    line = {"arrowstyle": "-", "color": "0.5", "linewidth": 0.8}
    axis.annotate(text, place, text_at, fontsize=8, color="0.2", va="center", arrowprops=line)


def rig_frame(axis: Axes, length: float) -> None:
    """+X right, +Z towards the cameras, +Y towards the reader."""
    arrow(axis, np.zeros(2), np.array([length, 0]), "X", FRAME)
    arrow(axis, np.zeros(2), np.array([0, length]), "Z", FRAME)
    axis.plot(0, 0, "o", color=FRAME, markersize=9, markerfacecolor="white")
    axis.plot(0, 0, ".", color=FRAME, markersize=5)
    axis.annotate("Y", (-0.4 * length, 0.3 * length), fontsize=9)


def paper_from_above(axis: Axes, rig: StereoRig) -> None:
    """Cameras, lines of sight, what they see, the cube, the largest object."""
    axis.add_patch(Rectangle((-0.5, -0.5), 1, 1, fill=False, edgecolor=CUBE, linewidth=1.4))
    axis.add_patch(Circle((0, 0), 0.5, fill=False, edgecolor=CUBE, linestyle=":"))
    for camera, color, name in zip(rig.cameras, COLORS, ("left", "right"), strict=True):
        center_2 = camera.center[[0, 2]]
        edges_22 = rays(camera, 1.55)[:, [0, 2]]
        axis.add_patch(Polygon([center_2, *edges_22], color=color, alpha=0.1))
        axis.plot(*zip(center_2, [0, 0], strict=True), "--", color=color, linewidth=1)
        camera_axes(axis, camera, 0.13, 1, color, name)
    x, z = rig.right.center[[0, 2]]
    dimension(axis, (-x, z + 0.3), (x, z + 0.3), f"baseline {rig.baseline:.3f} m", 0.06)
    dimension(axis, (x + 0.12, z), (0.12, 0.02), "", 0)
    axis.annotate("1 m", (0.27, 0.55), fontsize=9, color="0.2")
    half_angle = degrees(np.arctan2(x, z))
    for start, color in ((90, LEFT), (90 - half_angle, RIGHT)):
        axis.add_patch(Arc((0, 0), 1.5, 1.5, theta1=start, theta2=start + half_angle, color=color))
    note(axis, f"half angle\n{half_angle:.2f}° = π/16", (-0.08, 0.745), (-0.93, 0.72))
    axis.plot([0, 0], [0, z], color="0.6", linewidth=0.8, linestyle="-.")
    rig_frame(axis, 0.2)
    axis.annotate("working cube, side 1 m", (-0.5, -0.53), fontsize=8, color=CUBE)
    axis.annotate("sphere about an object\nof diagonal 1", (0, -0.3), fontsize=8, color=CUBE, ha="center")
    axis.set(xlim=(-0.98, 0.98), ylim=(1.42, -0.62), aspect="equal", title="from above: Y points at you")


def in_space(figure: Figure, position: tuple[int, int, int], rig: StereoRig) -> None:
    """The same in perspective; the plot's axes are X, -Z, Y, so that Y is up."""
    axis = figure.add_subplot(*position, projection="3d")
    turned = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # rows: rig X, Y, Z in the plot's axes
    for i, a in enumerate(CUBE_CORNERS_83):
        for b in CUBE_CORNERS_83[i + 1 :]:
            if np.count_nonzero(a != b) == 1:
                axis.plot(*(np.stack([a, b]) @ turned).T, color=CUBE, linewidth=1)
    for camera, color in zip(rig.cameras, COLORS, strict=True):
        edge = camera.width - 0.5
        corners_42 = np.array([[-0.5, -0.5], [edge, -0.5], [edge, edge], [-0.5, edge]])
        corners_43 = camera.unproject(corners_42, np.full(4, 0.22))
        for corner in corners_43:
            axis.plot(*(np.stack([camera.center, corner]) @ turned).T, color=color, linewidth=1)
        axis.plot(*(corners_43[[0, 1, 2, 3, 0]] @ turned).T, color=color)
        axis.plot(*(np.stack([camera.center, np.zeros(3)]) @ turned).T, "--", color=color, linewidth=1)
    for direction, name in zip(np.eye(3), "XYZ", strict=True):
        tip = 0.3 * direction @ turned
        axis.quiver(0, 0, 0, *tip, color=FRAME, arrow_length_ratio=0.2, linewidth=1.5)
        axis.text(*(1.25 * tip), name, fontsize=9)
    axis.set(xlim=(-0.6, 0.6), ylim=(-1.05, 0.55), zlim=(-0.6, 0.6))
    axis.set_axis_off()
    axis.view_init(elev=24, azim=-62)
    axis.set_box_aspect((1.2, 1.6, 1.2), zoom=1.15)
    axis.set_title("rig frame: X right, Y up, Z to the cameras", fontsize=10)


def rectified_from_above(axis: Axes, rig: StereoRig, config: RectifiedRigConfig) -> None:
    """Metres about the working cube, which lies about the object; crops within whole images."""
    unit = float(np.mean(config.fill) * np.mean(config.diagonal))
    reach = tan(radians(float(np.mean(config.fov_deg))) / 2)
    half = unit / 2
    depth = float(rig.left.camera_from_rig[2, 3]) * unit
    axis.add_patch(Rectangle((-half, -half), unit, unit, fill=False, edgecolor=CUBE, linewidth=1.4))
    for camera, color, name in zip(rig.cameras, COLORS, ("left", "right"), strict=True):
        center_2 = camera.center[[0, 2]] * unit
        far = depth + 1.3 * half
        whole = [center_2 + np.array([side * far * reach, -far]) for side in (-1, 1)]
        axis.add_patch(Polygon([center_2, *whole], color=color, alpha=0.06))
        edges_22 = rays(camera, far / unit)[:, [0, 2]] * unit
        axis.add_patch(Polygon([center_2, *edges_22], color=color, alpha=0.22))
        camera_axes(axis, camera, 0.045, unit, color, name)
    x, z = rig.right.center[[0, 2]] * unit
    dimension(axis, (-x, z + 0.14), (x, z + 0.14), f"baseline {2 * x:.3f} m", 0.035)
    dimension(axis, (-half, -half - 0.03), (half, -half - 0.03), f"unit: {unit:.2f} m", -0.03)
    rig_frame(axis, 0.085)
    axis.annotate("working cube: 1 unit,\nabout the object", (half + 0.02, -0.02), fontsize=8, color=CUBE)
    note(axis, "seen by both crops", (0.01, 0.42), (0.16, 0.5))
    note(axis, "seen by the whole images", (-0.25, 0.32), (-0.58, 0.62))
    axis.set(xlim=(-0.62, 0.62), ylim=(z + 0.2, -half - 0.1), aspect="equal")
    axis.set_title("rig=rectified, the middle of its ranges, from above: Y points at you", fontsize=10)


def main() -> None:
    rig, _ = rig_of("paper")
    figure = Figure(figsize=(10, 5.4), layout="constrained")
    axis = figure.add_subplot(1, 2, 1)
    paper_from_above(axis, rig)
    axis.set(xlabel="X, m", ylabel="Z, m")
    in_space(figure, (1, 2, 2), rig)
    figure.savefig(HERE / "paper.png", dpi=110)

    rig, config = rig_of("rectified")
    assert isinstance(config, RectifiedRigConfig)
    figure = Figure(figsize=(6, 6.6), layout="constrained")
    axis = figure.add_subplot()
    rectified_from_above(axis, rig, config)
    axis.set(xlabel="X, m", ylabel="Z, m")
    figure.savefig(HERE / "rectified.png", dpi=110)


if __name__ == "__main__":
    main()
