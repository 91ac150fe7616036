"""Inspected meshes kept on disk: a file is repaired once for all data sets, resolutions and runs.

An entry is named by the content of the file and by the code that reads and repairs it, so that neither a changed file
nor a changed repair meets an old result; where the file may refer to others, which differ from folder to folder, by its
place in the data set too. It appears under its name only when it is whole.
"""

import hashlib
import json
import os
import zipfile
from functools import cache
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.shapes.inspection import Inspection, inspect_mesh
from stereo_occ.shapes.reading import digest, fault_of, read_below
from stereo_occ.writing import whole_file

#: What reading an entry raises that is not there or not whole.
DAMAGED = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)

#: Of files that are all there is of a mesh.
ALONE = (".off", ".stl")


class MeshCache:
    """Inspected meshes in a folder. Files that cannot be read are inspected each time.

    Args:
        folder: made when the first entry is written.
        root: of the data set, see :func:`~stereo_occ.shapes.inspection.inspect_mesh`.
        colors: whether colours are wanted.
    """

    def __init__(self, folder: Path, root: Path, colors: bool) -> None:
        self.folder = folder
        self.root = root
        self.colors = colors

    def find(self, path: Path) -> Path | None:
        """The entry of a mesh file, None if it has none or one of the files it refers to has changed."""
        entry = self._entry(path)
        try:
            known = load(entry, header_only=True)
        except DAMAGED:
            return None
        fresh = (
            digest(read_below(path.parent / name, self.root)) == then
            for name, then in known.side_files.items()
        )
        return entry if known.checksum and all(fresh) else None

    def make(self, path: Path) -> Path:
        """Inspect a mesh file and write its entry.

        Raises:
            UserError: the cache cannot be written.
        """
        entry = self._entry(path)
        save(inspect_mesh(path, self.root, self.colors), entry)
        return entry

    def _entry(self, path: Path) -> Path:
        key = hashlib.sha256(f"{_code()} {path.suffix.lower()} {self.colors} ".encode())
        try:
            content = b"" if fault_of(path) else path.read_bytes()
        except OSError:
            content = b""
        if path.suffix.lower() not in ALONE:
            key.update(os.fsencode(os.path.relpath(path, self.root)) + b"\0")
        key.update(content or os.fsencode(path))
        return self.folder / f"{key.hexdigest()[:32]}.npz"


def save(inspection: Inspection, entry: Path) -> None:
    """Write an entry so that it is either absent or complete, whatever interrupts the writing."""
    arrays: dict[str, NDArray[Any]] = {}
    if inspection.mesh is not None:
        arrays = {"vertices": inspection.mesh.vertices, "faces": inspection.mesh.faces}
    if inspection.colors is not None:
        arrays["colors"] = inspection.colors
    header = {
        "steps": inspection.steps,
        "measures": dict(inspection.measures),
        "reason": inspection.reason,
        "checksum": inspection.checksum,
        "solid": inspection.solid,
        "likeness": inspection.likeness,
        "side_files": dict(inspection.side_files),
        "lost": inspection.lost,
    }
    content = BytesIO()
    np.savez(content, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **arrays)  # type: ignore[arg-type]
    try:
        with whole_file(entry) as file:
            file.write(content.getbuffer())
    except OSError as error:
        raise UserError(
            f"{entry.parent}: cannot be written ({error}); free some disk space or set paths.data"
        ) from error


def load(entry: Path, header_only: bool = False) -> Inspection:
    """Read an entry.

    Args:
        header_only: leave out mesh and colours.

    Raises:
        Exception: one of :data:`DAMAGED` if there is none or it is damaged.
    """
    with entry.open("rb") as file, np.load(file) as arrays:
        header = json.loads(arrays["header"].tobytes())
        mesh = None
        if "vertices" in arrays and not header_only:
            mesh = Trimesh(arrays["vertices"], arrays["faces"], process=False)
        colors = arrays["colors"] if "colors" in arrays and not header_only else None
    for name in ("steps", "likeness", "lost"):
        header[name] = tuple(header[name])
    return Inspection(mesh, colors, **header)


@cache
def _code() -> str:
    """What a result depends on besides the file: the code of reading and repair, and the libraries they rest on."""
    names = (
        "reading.py",
        "gltf.py",
        "surface_colors.py",
        "inspection.py",
        "quality.py",
        "distance.py",
        "repair/*.py",
        "../occupancy/*.py",
    )
    parts = [path.read_bytes() for name in names for path in sorted(Path(__file__).parent.glob(name))]
    libraries = [
        version(name) for name in ("trimesh", "manifold3d", "embreex", "scikit-image", "numpy", "scipy")
    ]
    return digest(b"".join([*parts, str(libraries + sorted(trimesh.available_formats())).encode()]))
