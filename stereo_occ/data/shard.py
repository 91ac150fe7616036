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
``views/depth``                         (N, 2, H, W) f2     metres along the optical axis, 0 is background
``views/K``                             (N, 2, 3, 3) f8     intrinsics, pixels
``views/camera_from_rig``               (N, 2, 4, 4) f8     extrinsics, metres
``views/rig_from_object``               (N, 4, 4) f8        pose: scale, rotation, translation
``views/unit``                          (N,) f8             metres per unit of the rig frame; absent: 1
``points/<pool>/grid``                  (P, 3) u2           see :class:`~stereo_occ.occupancy.pools.PointPool`
``points/<pool>/bounds``                (2, 3) f8           low corner and extent of the grid, object frame
``points/<pool>/part``                  (P,) u1             index into ``stereo_occ.shapes.shape.PARTS``; 0: outside
======================================  ==================  ========================================================

Every data set carries a Fletcher-32 checksum and the file's own structure is checksummed by HDF5's latest format, so
damage is an error and not a wrong number. A shard appears under its name only when it is whole.
"""

import json
import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, Self

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.geometry.pose import Pose
from stereo_occ.occupancy.pools import PointPool
from stereo_occ.shapes.shape import Shape

FORMAT = "stereo_occ.shard"
VERSION = 1
POOLS = ("box", "surface")
POINTS_PER_CHUNK = 8192


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


def write_shard(path: Path, shape: Shape, views: Views, pools: Mapping[str, PointPool]) -> None:
    """Write a shard so that ``path`` is either absent or complete, whatever interrupts the writing.

    Raises:
        UserError: the disk is full or the folder cannot be written.
    """
    temporary = partial_path(path, socket.gethostname(), os.getpid())
    image = _file_image(shape, views, pools)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as file:
            file.write(image)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise UserError(
            f"{path}: cannot write the shard ({error}); free some disk space or set paths.data"
        ) from error
    finally:
        with suppress(NotADirectoryError):
            temporary.unlink(missing_ok=True)


def _file_image(shape: Shape, views: Views, pools: Mapping[str, PointPool]) -> memoryview:
    """The bytes of the file, made in memory: where a disk is full, HDF5 crashes instead of raising."""
    image = BytesIO()
    with h5py.File(image, "w", libver="latest", track_order=False) as file:
        file.attrs["version"] = VERSION
        for name, text in (
            ("format", FORMAT),
            ("category", shape.category),
            ("object_id", shape.object_id),
            ("facts", json.dumps(dict(shape.facts), sort_keys=True)),
        ):
            # Of fixed length: strings of variable length lie in a heap that HDF5 keeps without a checksum.
            file.attrs[name] = np.bytes_(text.encode())
        _write(file, "mesh/vertices", shape.mesh.vertices.astype(np.float32))
        _write(file, "mesh/faces", shape.mesh.faces.astype(np.int32))
        for name, array in vars(views).items():
            if array is not None:
                _write(file, f"views/{name}", array, chunk_length=1)
        for name, pool in pools.items():
            _write(file, f"points/{name}/grid", pool.grid_N3, chunk_length=POINTS_PER_CHUNK)
            _write(file, f"points/{name}/bounds", np.stack([pool.low_3, pool.extent_3]))
            _write(file, f"points/{name}/part", pool.part_N, chunk_length=POINTS_PER_CHUNK)
    return image.getbuffer()


def partial_path(path: Path, host: str, process: int) -> Path:
    """Where a process writes a shard before it gets its name."""
    return path.with_name(f".{path.name}.{host}.{process}.part")


def remove_partial(folder: Path) -> None:
    """Remove what killed processes of this machine left behind in the category folders of ``folder``."""
    for partial in folder.glob("*/.*.part"):
        _, process, _ = partial.name.rsplit(".", 2)
        if f".{socket.gethostname()}.{process}." in partial.name and not _is_alive(int(process)):
            partial.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        return True
    return True


def _write(file: h5py.File, name: str, array: NDArray[Any], chunk_length: int | None = None) -> None:
    length = len(array) if chunk_length is None else min(chunk_length, len(array))
    file.create_dataset(
        name,
        data=array,
        chunks=(length, *array.shape[1:]),
        fletcher32=True,
        track_times=False,
        **hdf5plugin.Zstd(clevel=3),
    )


class Shard:
    """A shard opened for reading. The file is opened at first use and stays open; :meth:`close` releases it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def _file(self) -> h5py.File:
        try:
            file = h5py.File(self.path, "r", rdcc_nbytes=0)
            form, version = _text(file.attrs.get("format")), file.attrs.get("version")
        except (OSError, RuntimeError) as error:
            raise self._damaged(error) from error
        if form != FORMAT or version != VERSION:
            raise UserError(
                f"{self.path}: is {form} version {version}, expected {FORMAT} version {VERSION}; "
                f"delete it and render again"
            )
        return file

    def _damaged(self, error: Exception) -> UserError:
        return UserError(f"{self.path}: cannot read the shard ({error}); delete it and render again")

    @cached_property
    def _opened(self) -> dict[str, h5py.Dataset]:
        return {}

    def _dataset(self, name: str) -> h5py.Dataset:
        try:
            if name not in self._opened:  # opening a data set takes longer than reading one view
                self._opened[name] = self._file[name]
        except (OSError, KeyError, RuntimeError) as error:
            raise self._damaged(error) from error
        return self._opened[name]

    def _read(self, name: str, selection: Any = ...) -> NDArray[Any]:
        try:
            return np.asarray(self._dataset(name)[selection])
        except (OSError, RuntimeError) as error:
            raise self._damaged(error) from error

    def _text(self, name: str) -> str:
        try:
            return _text(self._file.attrs[name])
        except (OSError, KeyError, RuntimeError) as error:
            raise self._damaged(error) from error

    def __len__(self) -> int:
        return len(self._dataset("views/rgb"))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; the next access opens it again."""
        if "_file" in vars(self):
            self._file.close()
        self.__dict__ = self.__getstate__()

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path}

    @cached_property
    def category(self) -> str:
        """The object's category."""
        return self._text("category")

    @cached_property
    def object_id(self) -> str:
        """The object's name, unique within its data set."""
        return self._text("object_id")

    @property
    def facts(self) -> dict[str, Any]:
        """Plain figures about the object."""
        return dict(json.loads(self._text("facts")))

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
        """Left and right depth ``(2, H, W)`` in metres; 0 is background."""
        return self._read("views/depth", view)

    @cached_property
    def cameras(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """``K (N, 2, 3, 3)`` and ``camera_from_rig (N, 2, 4, 4)`` of all views."""
        return self._read("views/K"), self._read("views/camera_from_rig")

    @cached_property
    def poses(self) -> list[Pose]:
        """The object's pose in each view."""
        return [Pose.from_matrix(matrix) for matrix in self._read("views/rig_from_object")]

    @cached_property
    def unit_N(self) -> NDArray[np.float64]:
        """Metres per unit of the rig frame in each view: what turns a reconstruction into metres."""
        return self._read("views/unit") if "views/unit" in self._file else np.ones(len(self))

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
                if isinstance(node := self._file[name], h5py.Dataset):
                    node[...]
        except (OSError, KeyError, RuntimeError) as error:
            raise self._damaged(error) from error


def _text(attribute: Any) -> str:
    return attribute.decode() if isinstance(attribute, bytes) else str(attribute)
