"""What a mesh file holds: triangles in their places, and colours where it has some."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path, PurePosixPath
from stat import S_ISREG
from urllib.parse import unquote

import numpy as np
import trimesh
from PIL import Image
from trimesh import Trimesh
from trimesh.resolvers import FilePathResolver
from trimesh.visual import TextureVisuals

from stereo_occ.errors import UserError
from stereo_occ.shapes.gltf import unread
from stereo_occ.shapes.surface_colors import SurfaceColors, surface_colors

#: Larger files, and those of more triangles, are not read; scans of household objects have a hundredth of that.
MOST_BYTES = 1_000_000_000
MOST_TRIANGLES = 5_000_000

#: Endings of the pictures that are looked at before trimesh is given them; none that another program would draw.
PICTURES = (".png", ".jpg", ".jpeg", ".tga", ".bmp", ".tif", ".tiff", ".webp", ".gif")

#: Longest side of the bounding box, in the file's own unit.
SIZES = (1e-4, 1e7)


@dataclass(frozen=True, eq=False)
class RawMesh:
    """A file as it was found.

    Attributes:
        mesh: all parts of the scene in their places, in the file's frame; neither closed nor clean.
        colors: None where it has none.
        side_files: SHA-256 of the other files that were read, by name relative to the file's folder; empty text for
            those that were asked for and not found.
        lost: what else the file asks for and could not be read, in words.
    """

    mesh: Trimesh
    colors: SurfaceColors | None
    side_files: dict[str, str]
    lost: tuple[str, ...] = ()


class SideFiles(FilePathResolver):
    """Materials, textures and buffers of a model below ``root``; notes which were asked for."""

    def __init__(self, source: Path, root: Path) -> None:
        super().__init__(str(source))
        self.root = root.resolve()
        self.seen: dict[str, str] = {}
        self.lost: dict[str, str] = {}

    def get(self, name: str) -> bytes:
        """The content of a file named relative to the model's folder.

        Where there is none, the name is taken without glTF's escapes, and then the file is looked for beside the model:
        by the last part of a path, as of another computer, and by the last word of a line, as after an MTL's options.

        Raises:
            FileNotFoundError: it is not there, or not below the data set's root.
        """
        name = name.strip().replace("\\", "/")
        last = PurePosixPath(unquote(name)).name
        for candidate in dict.fromkeys((name, unquote(name), last, *last.split()[-1:])):
            content = read_below(Path(self.parent) / candidate, self.root)
            self.seen[candidate] = digest(content)
            if content is not None:
                if not _is_sound(candidate, content):
                    self.lost[name] = "is no sound picture"
                return content
        self.lost[name] = "is not there"
        raise FileNotFoundError(name)

    def namespaced(self, namespace: str) -> "SideFiles":
        """The same folder: names are kept relative to the model."""
        return self


def read_below(path: Path, root: Path) -> bytes | None:
    """The content of a file, None where there is none below ``root``, or one that :func:`fault_of` something is."""
    try:
        resolved = path.resolve()
        readable = resolved.is_relative_to(root.resolve()) and not fault_of(resolved)
        return resolved.read_bytes() if readable else None
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return None


def fault_of(path: Path) -> str:
    """Why a file is not even to be opened, empty if it is: a pipe would be waited for, a device never ends.

    Raises:
        OSError: there is no such file.
    """
    status = path.stat()
    if not S_ISREG(status.st_mode):
        return "is no regular file"
    if status.st_size > MOST_BYTES:
        return f"has {status.st_size / 1e9:.1f} GB, at most {MOST_BYTES / 1e9:g} are read; simplify it"
    return ""


def digest(content: bytes | None) -> str:
    """SHA-256 as text, empty for None."""
    return "" if content is None else hashlib.sha256(content).hexdigest()


def _is_sound(name: str, content: bytes) -> bool:
    """Whether a file is no picture by its ending, or one that can be read: trimesh would take a broken one for grey."""
    if PurePosixPath(name).suffix.lower() not in PICTURES:
        return True
    try:
        Image.open(BytesIO(content)).load()
    except Exception:  # of any kind, as the parsers' of pictures are
        return False
    return True


def read_mesh(path: Path, root: Path, colors: bool) -> RawMesh:
    """Read a file of any known format. Other files that it refers to are read if they lie below ``root``.

    Vertices that the format splits (by normals, texture coordinates, or all of them as STL does) are merged.

    Raises:
        UserError: the file cannot be read or holds no triangles; the message is the reason alone.
    """
    file_type = path.suffix.lower().removeprefix(".")
    if file_type not in trimesh.available_formats():
        raise UserError(f"reading {path.suffix} files needs pycollada: pip install 'pycollada>=0.8'")
    try:
        reason = fault_of(path) or (unread(path) if file_type in ("glb", "gltf") else "")
    except OSError as error:
        raise UserError(f"cannot be read: {_words(error)}") from error
    if reason:
        raise UserError(reason)
    side_files = SideFiles(path, root)
    lost: tuple[str, ...] = ()
    for with_colors in (True, False) if colors else (False,):  # its pictures may be what is broken
        try:
            mesh, found = _read(path, side_files, with_colors)
        except (UserError, MemoryError):
            raise
        except Exception as error:  # a broken file makes the parsers fail in any way
            failure = error
            lost = (f"colours: {_words(error)}",)
        else:
            lost += tuple(f"{name} {why}" for name, why in side_files.lost.items())
            return RawMesh(mesh, found, dict(side_files.seen), lost)
    raise UserError(f"cannot be read: {_words(failure)}") from failure


def _parts(scene: trimesh.Scene) -> Iterator[Trimesh]:
    """Its meshes with triangles in their places, with colours of vertices that a copy of a material's mesh forgets."""
    for node in scene.graph.nodes_geometry:
        matrix_44, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, Trimesh) and len(geometry.faces):
            part = geometry.copy()
            if isinstance(geometry.visual, TextureVisuals) and isinstance(part.visual, TextureVisuals):
                part.visual.vertex_attributes.update(dict(geometry.visual.vertex_attributes))
            yield part.apply_transform(matrix_44)


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _read(path: Path, side_files: SideFiles, colors: bool) -> tuple[Trimesh, SurfaceColors | None]:
    scene = trimesh.load_scene(path, resolver=side_files, process=False, skip_materials=not colors)
    parts = [*_parts(scene)]
    if not parts:
        raise UserError("holds no triangles")
    if (triangles := sum(len(part.faces) for part in parts)) > MOST_TRIANGLES:
        raise UserError(
            f"has {triangles / 1e6:.1f} million triangles, at most {MOST_TRIANGLES / 1e6:g} are read; simplify it"
        )
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    mesh = Trimesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, offsets[:-1], strict=True)]),
        process=False,
    )
    if not np.isfinite(mesh.vertices).all():
        raise UserError("has vertices that are not finite numbers")
    if not SIZES[0] <= (side := float(np.ptp(mesh.vertices, axis=0).max())) <= SIZES[1]:
        raise UserError(f"is {side:g} units large, expected {SIZES[0]:g} to {SIZES[1]:g}; scale it")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return mesh, surface_colors(parts) if colors else None
