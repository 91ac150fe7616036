"""Calibrations of real cameras, from files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stereo_occ.calibration.fields import Fields
from stereo_occ.calibration.formats import from_opencv, from_own, from_ros
from stereo_occ.calibration.lens import Lens
from stereo_occ.calibration.pair import UNITS, RealCamera, RealPair
from stereo_occ.errors import UserError

__all__ = ["Lens", "RealCamera", "RealPair", "read_calibration"]


def read_calibration(
    paths: str | Path | Sequence[str | Path], unit: str | float | None = None, rectified: bool = False
) -> RealPair:
    """A calibrated pair from OpenCV's files, a pair of ROS camera_info files (left first), or our own YAML.

    Args:
        paths: one file, or several: left and right camera_info, or intrinsics and extrinsics.
        unit: of lengths in the files: m, cm, mm, in, or metres as a number (the side of a chessboard's square, where
            that was 1); None: what the file says under ``unit``, else metres.
        rectified: whether the images are rectified already, by these files' P1 and P2; our own describe their images.

    Raises:
        UserError: a file cannot be read, is of no known kind, or describes no pair.
    """
    paths = [paths] if isinstance(paths, str | Path) else list(paths)
    files = [Fields.read(Path(path)) for path in paths]
    if not files:
        raise UserError("rig: names no file")
    if len(files) == 2 and all(_is_camera_info(fields) for fields in files):
        return from_ros(files[0], files[1], metres_per_unit(unit, files[0].values), rectified)
    fields = Fields(
        {key: value for file in files for key, value in file.values.items()},
        " + ".join(f.source for f in files),
    )
    metres = metres_per_unit(unit, fields.values)
    if "left" in fields and "right" in fields:
        left, right = fields.part("left"), fields.part("right")
        if _is_camera_info(left) and _is_camera_info(right):
            return from_ros(left, right, metres, rectified)
        return from_own(fields, metres, rectified)
    if _is_camera_info(fields):
        raise UserError(
            f"rig={fields.source}: is of one camera; give both, left first: 'rig=[left.yaml,right.yaml]'"
        )
    if (rectified and "P1" in fields) or "R" in fields or "T" in fields:
        return from_opencv(fields, metres, rectified)
    raise UserError(
        f"rig={fields.source}: is no known calibration; expected K1, D1, K2, D2, R, T (OpenCV), two camera_info files "
        f"(ROS) or left and right (our own), found {', '.join(list(fields.values)[:8])}"
    )


def metres_per_unit(unit: str | float | None, values: Mapping[str, Any]) -> float:
    """The factor of lengths; ``unit`` counts before the file's own."""
    unit = values.get("unit", "m") if unit is None else unit
    if str(unit) in UNITS:
        return UNITS[str(unit)]
    try:
        metres = float(unit)
    except (TypeError, ValueError):
        metres = 0.0
    if not 1e-9 <= metres <= 1000:
        raise UserError(
            f"unit={unit}: must be one of {', '.join(UNITS)} or metres as a number, such as 0.025"
        )
    return metres


def _is_camera_info(fields: Fields) -> bool:
    return (
        "projection_matrix" in fields
        or ("P" in fields and ("K" in fields or "distortion_model" in fields))
        or ("p" in fields and "k" in fields)
    )
