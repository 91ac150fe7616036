"""The shard: one HDF5 file per object, holding its rendered pairs, poses, cameras and labelled points.

======================================  ==================  ========================================================
path                                    shape, type         meaning
======================================  ==================  ========================================================
``@format``, ``@version``               str, int            ``stereo_occ.shard``, :data:`VERSION`
``@category``, ``@object_id``           str
``@facts``                              str                 JSON: what is known about the object
``mesh/vertices``, ``mesh/faces``       (V, 3) f4, (F, 3)   object frame
``views/rgb``                           (N, 2, H, W, 3) u1  left, right
``views/mask``                          (N, 2, H, W) u1     coverage, 255 is the object
``views/depth``                         (N, 2, H, W) f2     units of the rig frame along the optical axis; 0: none
``views/K``                             (N, 2, 3, 3) f8     intrinsics, pixels
``views/camera_from_rig``               (N, 2, 4, 4) f8     extrinsics, units of the rig frame
``views/rig_from_object``               (N, 4, 4) f8        pose: scale, rotation, translation
``views/unit``                          (N,) f8             metres per unit of the rig frame; absent: 1
``points/<pool>/grid``                  (P, 3) u2           see :class:`~stereo_occ.occupancy.pools.PointPool`
``points/<pool>/bounds``                (2, 3) f8           low corner and extent of the grid, object frame
``points/<pool>/part``                  (P,) u1             index into ``stereo_occ.shapes.shape.PARTS``; 0: outside
======================================  ==================  ========================================================

Every data set carries a Fletcher-32 checksum and the file's own structure is checksummed by HDF5's latest format, so
damage is an error and not a wrong number. What a shard holds is in the shard: links and arrays that lead to other files
are refused, and names that are no plain names. A shard appears under its name only when it is whole. Beside it lies the
SHA-256 of the whole file (:func:`checksum_path`), as ``sha256sum`` writes it.
"""

import errno
import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import h5py
import hdf5plugin  # noqa: F401 (its filters decompress)
import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.data.open_shards import forget, use
from stereo_occ.data.shard_arrays import DAMAGED, array_of
from stereo_occ.errors import UserError
from stereo_occ.geometry.pose import Pose
from stereo_occ.occupancy.pools import PointPool
from stereo_occ.system_errors import REMEDIES

FORMAT = "stereo_occ.shard"
VERSION = 1

#: What keeps a shard from being read that may be as it should.
NO_DAMAGE = (errno.EMFILE, errno.ENFILE, errno.EACCES, errno.EPERM, errno.EIO)

#: Of more views than this the cameras and poses are read one by one: those of a thousand take a tenth of a second.
ROWS_AT_ONCE = 128


@dataclass(frozen=True, eq=False)
class Views:
    """Rendered pairs of one object: the arrays of ``views/`` in the table above."""

    rgb: NDArray[np.uint8]
    mask: NDArray[np.uint8]
    depth: NDArray[np.float16]
    K: NDArray[np.float64]
    camera_from_rig: NDArray[np.float64]
    rig_from_object: NDArray[np.float64]
    unit: NDArray[np.float64] | None = None


def checksum_path(path: Path) -> Path:
    """Where the checksum of a shard is."""
    return path.with_name(f"{path.name}.sha256")


class Shard:
    """A shard opened for reading.

    The file is opened at first use and stays open with all that was read, until :meth:`close` or until a few hundred
    other shards have been used since (:mod:`stereo_occ.data.open_shards`); the next use opens it again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def _file(self) -> h5py.File:
        use(self)
        try:
            file = h5py.File(self.path, "r", rdcc_nbytes=0)
            form, version = _text(file.attrs.get("format")), file.attrs.get("version")
        except DAMAGED as error:
            raise self._damaged(error) from error
        if form != FORMAT or version != VERSION:
            raise UserError(
                f"{self.path}: is {form} version {version}, expected {FORMAT} version {VERSION}; "
                f"delete it and render again"
            )
        return file

    def _damaged(self, error: Exception) -> UserError:
        if isinstance(error, OSError) and error.errno in NO_DAMAGE:
            return UserError(f"{self.path}: {os.strerror(error.errno)}; {REMEDIES[error.errno]}")
        reason = " ".join(str(error).split())
        return UserError(f"{self.path}: cannot read the shard ({reason}); delete it and render again")

    @cached_property
    def _opened(self) -> dict[str, h5py.Dataset]:
        return {}

    def _dataset(self, name: str) -> h5py.Dataset:
        use(self)
        try:
            if name not in self._opened:  # opening a data set takes longer than reading one view
                self._opened[name] = array_of(self._file, name)
        except DAMAGED as error:
            raise self._damaged(error) from error
        return self._opened[name]

    def _read(self, name: str, selection: Any = ...) -> NDArray[Any]:
        try:
            return np.asarray(self._dataset(name)[selection])
        except DAMAGED as error:
            raise self._damaged(error) from error

    def _text(self, name: str) -> str:
        try:
            return _text(self._file.attrs[name])
        except DAMAGED as error:
            raise self._damaged(error) from error

    def _name(self, attribute: str) -> str:
        """A text that becomes part of file names."""
        name = self._text(attribute)
        if not name or name.startswith(".") or "/" in name or "\\" in name or not name.isprintable():
            raise self._damaged(ValueError(f"{attribute} {name!r} is no plain name"))
        return name

    def __len__(self) -> int:
        return len(self._dataset("views/rgb"))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; the next access opens it again.

        h5py closes what nobody refers to. Its own ``close`` looks through all that is open: 30 ms with 700 shards.
        """
        forget(self)
        self.__dict__ = self.__getstate__()

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path}

    @cached_property
    def category(self) -> str:
        """The object's category."""
        return self._name("category")

    @cached_property
    def object_id(self) -> str:
        """The object's name, unique within its data set."""
        return self._name("object_id")

    @property
    def facts(self) -> dict[str, Any]:
        """Plain figures about the object."""
        try:
            return dict(json.loads(self._text("facts")))
        except (ValueError, TypeError) as error:
            raise self._damaged(error) from error

    @property
    def mesh(self) -> Trimesh:
        """The object's solid, object frame."""
        return Trimesh(self._read("mesh/vertices"), self._read("mesh/faces"), process=False)

    def rgb(self, view: int) -> NDArray[np.uint8]:
        """Left and right image ``(2, H, W, 3)``."""
        return self._read("views/rgb", view)

    def mask(self, view: int) -> NDArray[np.uint8]:
        """Left and right coverage ``(2, H, W)``, 0 to 255."""
        return self._read("views/mask", view)

    def depth(self, view: int) -> NDArray[np.float16]:
        """Left and right depth ``(2, H, W)`` in units of the rig frame; 0 is background."""
        return self._read("views/depth", view)

    def cameras(self, view: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """``K (2, 3, 3)`` and ``camera_from_rig (2, 4, 4)``, left and right."""
        return self._row("views/K", view), self._row("views/camera_from_rig", view)

    def pose(self, view: int) -> Pose:
        """The object's pose."""
        return Pose.from_matrix(self._row("views/rig_from_object", view))

    def unit(self, view: int) -> float:
        """Metres per unit of the rig frame."""
        return float(self._row("views/unit", view)) if "views/unit" in self._file else 1.0

    @cached_property
    def _rows(self) -> dict[str, tuple[NDArray[np.float64], NDArray[np.bool_]]]:
        return {}

    def _row(self, name: str, view: int) -> NDArray[np.float64]:
        """One row of a small data set, read once: all at a time, or of very many each when it is asked for."""
        if name not in self._rows:
            dataset = self._dataset(name)
            few = len(dataset) <= ROWS_AT_ONCE
            rows = self._read(name) if few else np.empty(dataset.shape)
            self._rows[name] = rows, np.full(len(dataset), few)
        rows, known = self._rows[name]
        if not known[view]:
            rows[view] = self._read(name, view)
            known[view] = True
        row: NDArray[np.float64] = rows[view]
        return row

    @cached_property
    def _pools(self) -> dict[str, PointPool]:
        return {}

    def pool(self, name: str) -> PointPool:
        """The point pool ``box`` or ``surface``; kept in memory."""
        if name not in self._pools:
            part_N = self._read(f"points/{name}/part")
            low_3, extent_3 = self._read(f"points/{name}/bounds")
            self._pools[name] = PointPool(
                self._read(f"points/{name}/grid"), low_3, extent_3, part_N > 0, part_N
            )
        return self._pools[name]

    def verify(self) -> None:
        """Read everything once, so that any damage raises :class:`UserError`."""
        names: list[str] = []
        try:
            self._file.visit(names.append)
            for name in names:
                if isinstance(self._file[name], h5py.Dataset):
                    array_of(self._file, name)[...]
        except DAMAGED as error:
            raise self._damaged(error) from error


def _text(attribute: Any) -> str:
    return attribute.decode() if isinstance(attribute, bytes) else str(attribute)
