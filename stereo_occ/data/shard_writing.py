"""Writing shards: whole or not at all, with a checksum of the file beside it."""

import hashlib
import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from stereo_occ.data.shard import FORMAT, VERSION, Views, checksum_path
from stereo_occ.errors import UserError
from stereo_occ.occupancy.pools import PointPool
from stereo_occ.shapes.shape import Shape
from stereo_occ.writing import whole_file

POINTS_PER_CHUNK = 8192

#: Version of HDF5's own form, whatever newer ones the library may know.
HDF5 = ("v200", "v200")


def write_shard(path: Path, shape: Shape, views: Views, pools: Mapping[str, PointPool]) -> None:
    """Write a shard so that ``path`` is either absent or complete, whatever interrupts the writing.

    Raises:
        UserError: the disk is full or the folder cannot be written.
    """
    image = _file_image(shape, views, pools)
    checksum = f"{hashlib.sha256(image).hexdigest()}  {path.name}\n".encode()
    try:
        # The inner file is there first, so no shard without its checksum; a full disk shows before either is.
        with whole_file(path) as shard_file, whole_file(checksum_path(path)) as checksum_file:
            shard_file.write(image)
            shard_file.flush()
            checksum_file.write(checksum)
    except OSError as error:
        raise UserError(
            f"{path}: cannot write the shard ({error}); free some disk space or set paths.data"
        ) from error


def _file_image(shape: Shape, views: Views, pools: Mapping[str, PointPool]) -> memoryview:
    """The bytes of the file, made in memory: where a disk is full, HDF5 crashes instead of raising."""
    image = BytesIO()
    with h5py.File(image, "w", libver=HDF5, track_order=False) as file:
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
