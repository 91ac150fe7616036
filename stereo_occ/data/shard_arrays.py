"""The arrays of a shard: what each must be, and that they lie in the file itself."""

import h5py
import numpy as np

POOLS = ("box", "surface")

#: Type and shape of each array, None where the length is free.
ARRAYS: dict[str, tuple[str, tuple[int | None, ...]]] = {
    "mesh/vertices": ("f4", (None, 3)),
    "mesh/faces": ("i4", (None, 3)),
    "views/rgb": ("u1", (None, 2, None, None, 3)),
    "views/mask": ("u1", (None, 2, None, None)),
    "views/depth": ("f2", (None, 2, None, None)),
    "views/K": ("f8", (None, 2, 3, 3)),
    "views/camera_from_rig": ("f8", (None, 2, 4, 4)),
    "views/rig_from_object": ("f8", (None, 4, 4)),
    "views/unit": ("f8", (None,)),
} | {
    f"points/{pool}/{name}": form
    for pool in POOLS
    for name, form in (("grid", ("u2", (None, 3))), ("bounds", ("f8", (2, 3))), ("part", ("u1", (None,))))
}

#: What reading a shard raises that is damaged, or none.
DAMAGED = (OSError, KeyError, RuntimeError, ValueError, IndexError, TypeError)


def array_of(file: h5py.File, name: str) -> h5py.Dataset:
    """An array that lies in the file itself and has the form of its place.

    Raises:
        Exception: one of :data:`DAMAGED`.
    """
    parts = name.split("/")
    places = ["/".join(parts[:depth]) for depth in range(1, len(parts) + 1)]
    if not all(isinstance(file.get(place, getlink=True), h5py.HardLink) for place in places):
        raise ValueError(f"{name} is missing, or a link to elsewhere")
    array = file[name]
    kind, shape = ARRAYS[name]
    if not (
        isinstance(array, h5py.Dataset)
        and array.external is None
        and not array.is_virtual
        and array.dtype == np.dtype(kind)
        and array.ndim == len(shape)
        and all(asked in (None, length) for asked, length in zip(shape, array.shape, strict=True))
    ):
        raise ValueError(f"{name} is no array of type {kind} and shape {shape} in the file itself")
    return array
