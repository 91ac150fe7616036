"""Numbers and matrices in the text of calibration files: OpenCV's FileStorage, ROS and plain YAML or JSON."""

import reprlib
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from stereo_occ.errors import UserError

#: Calibrations have a few kilobytes.
MOST_BYTES = 1_000_000

#: The longest array has 14 numbers. References in a file of a few lines can stand for billions.
MOST_NUMBERS = 1000


#: Of the numbers in a calibration, whatever their unit.
LARGEST = 1e9


class _Loader(yaml.SafeLoader):
    """Plain values, and OpenCV's tagged ones as what they hold."""


def _opencv(loader: _Loader, suffix: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    raise yaml.constructor.ConstructorError(None, None, f"unexpected tag {suffix}", node.start_mark)


_Loader.add_multi_constructor("tag:yaml.org,2002:opencv-", _opencv)


class Fields:
    """The content of one calibration, from one file or several.

    Args:
        paths: files, whose keys are put together.

    Raises:
        UserError: a file cannot be read, or is neither YAML nor JSON with keys.
    """

    def __init__(self, values: Mapping[str, Any], source: str) -> None:
        self.values, self.source = values, source

    @classmethod
    def read(cls, path: Path) -> "Fields":
        """Of a file."""
        try:
            if (size := path.stat().st_size) > MOST_BYTES:
                raise UserError(
                    f"rig={path}: has {size / 1e6:.1f} MB, so it is no calibration; give its YAML or JSON"
                )
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "not text"
            raise UserError(f"rig={path}: cannot be read ({reason})") from error
        # OpenCV heads its files "%YAML:1.0", which is no YAML.
        text = "\n".join(line for line in text.splitlines() if not line.startswith("%YAML"))
        try:
            values = next(yaml.load_all(text, _Loader), None)  # ROS ends each message with "---"
        except (yaml.YAMLError, RecursionError, ValueError) as error:  # ValueError: of dates and numbers
            mark = getattr(error, "problem_mark", None)
            where = f", line {mark.line + 1}" if mark else ""
            raise UserError(f"rig={path}: is neither YAML nor JSON{where}") from error
        if not isinstance(values, dict) or not values:
            raise UserError(f"rig={path}: holds no keys; give a calibration as docs/own-camera.md describes")
        return cls({str(key): value for key, value in values.items()}, str(path))

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def first(self, *keys: str) -> str | None:
        """Which of the keys is there."""
        return next((key for key in keys if key in self.values), None)

    def part(self, key: str) -> "Fields":
        """The keys below one."""
        value = self.values.get(key)
        if not isinstance(value, dict):
            raise UserError(f"rig={self.source}: {key} must hold keys of its own, got {brief(value)}")
        return Fields({str(name): part for name, part in value.items()}, f"{self.source}: {key}")

    def text(self, key: str, default: str) -> str:
        """A word."""
        return str(self.values.get(key, default))

    def array(self, *keys: str, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
        """The numbers under the first of ``keys`` that is there: nested lists, or OpenCV's and ROS's matrices."""
        key = self.first(*keys)
        if key is None:
            raise UserError(f"rig={self.source}: has no key {' or '.join(keys)}")
        value = self.values[key]
        if isinstance(value, dict) and "data" in value:
            value = value["data"]
        try:
            if len(list(islice(_leaves(value), MOST_NUMBERS + 1))) > MOST_NUMBERS:
                raise ValueError
            numbers = np.asarray(value, dtype=object).astype(np.float64)
            numbers = numbers if shape is None else numbers.reshape(shape)
        except (TypeError, ValueError, RecursionError) as error:
            wanted = f"{' x '.join(map(str, shape))} numbers" if shape else "numbers"
            raise UserError(f"rig={self.source}: {key} must be {wanted}, got {brief(value)}") from error
        if (np.abs(numbers[np.isfinite(numbers)]) > LARGEST).any():
            raise UserError(
                f"rig={self.source}: {key} holds numbers above {LARGEST:g}, got {brief(value)}; check it"
            )
        return numbers

    def size(self) -> tuple[int, int] | None:
        """Width and height of the images, where they are given."""
        if key := self.first("image_size", "imageSize", "size"):
            width, height = self.array(key, shape=(2,))
        elif ("image_width" in self or "width" in self) and ("image_height" in self or "height" in self):
            width = self.array("image_width", "width", shape=())
            height = self.array("image_height", "height", shape=())
        else:
            return None
        if not (1 <= width < np.inf and 1 <= height < np.inf):
            raise UserError(
                f"rig={self.source}: image size must be positive numbers of pixels, got {width:g} x {height:g}"
            )
        return int(width), int(height)


def brief(value: Any) -> str:
    """A value for a message, cut short."""
    shortener = reprlib.Repr()
    shortener.maxlevel, shortener.maxlist = 2, 4
    return shortener.repr(value)[:80]


def _leaves(value: Any) -> Iterator[Any]:
    """What nested lists hold."""
    if not isinstance(value, list):
        yield value
        return
    for part in value:
        yield from _leaves(part)
