"""A mesh file made into a solid, or the reason why it is none."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.shapes.layouts import MeshFile, UpAxis
from stereo_occ.shapes.reading import read_mesh
from stereo_occ.shapes.repair import repair
from stereo_occ.shapes.shape import Fact, Shape

#: From a frame with +Z up to the object frame's axes, +Y up: a quarter turn about X.
TURNS = {UpAxis.y: np.eye(3), UpAxis.z: np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}


@dataclass(frozen=True, eq=False)
class Inspection:
    """What became of a mesh file.

    Attributes:
        mesh: a solid in the file's own frame; of a rejected file what was found in it, None if it cannot be read.
        colors: of the vertices of a solid ``(V, 3)``, sRGB; None where the file has none or they are not wanted.
        steps: of the repair, in order.
        measures: figures of the repair by name.
        reason: why the file was rejected, in one line; empty if it was not.
        checksum: eight characters that change with mesh and colours; empty if the file cannot be read.
        solid: the same of the mesh alone.
        likeness: of a solid, figures that copies share wherever they are, turned, scaled or written to another format.
        side_files: SHA-256 of the other files it refers to, see :class:`~stereo_occ.shapes.reading.RawMesh`.
        lost: what the file asks for and could not be read, in words; likewise.
    """

    mesh: Trimesh | None
    colors: NDArray[np.uint8] | None = None
    steps: tuple[str, ...] = ()
    measures: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""
    checksum: str = ""
    solid: str = ""
    likeness: tuple[float, ...] = ()
    side_files: Mapping[str, str] = field(default_factory=dict)
    lost: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """``clean``, ``repaired`` or ``rejected``."""
        return "rejected" if self.reason else "repaired" if self.steps else "clean"

    def shape(self, file: MeshFile) -> Shape:
        """The object, upright; of its facts, ``file_from_object`` is the 4x4 matrix back to the file's own frame."""
        assert self.mesh is not None
        assert not self.reason
        turn = np.eye(4)
        turn[:3, :3] = TURNS[file.up]
        mesh = self.mesh.copy().apply_transform(turn)
        facts: dict[str, Fact] = {
            "file": file.path.name,
            "status": self.status,
            "repair": "; ".join(self.steps),
            "faces": len(self.mesh.faces),
            "bodies": self.mesh.body_count,
            "file_from_object": file_from_object(self.mesh, file.up).tolist(),
            **self.measures,
        }
        return Shape(file.category, file.object_id, mesh, facts=facts, colors=self.colors).normalized()


def inspect_mesh(path: Path, root: Path, colors: bool) -> Inspection:
    """Read and repair one file; what is wrong with it is the result's reason, not an error.

    Args:
        root: of the data set; materials and buffers outside it are not read.
        colors: whether to read the file's colours.
    """
    try:
        raw = read_mesh(path, root, colors)
    except UserError as error:
        return Inspection(None, reason=str(error))
    try:
        repaired = repair(raw.mesh)
    except UserError as error:
        checksum = _checksum(raw.mesh)
        return Inspection(
            raw.mesh,
            reason=str(error),
            checksum=checksum,
            solid=checksum,
            side_files=raw.side_files,
            lost=raw.lost,
        )
    mesh = repaired.mesh
    own = None if raw.colors is None else raw.colors.at(mesh.vertices)
    measures = {name: float(value) for name, value in repaired.measures.items()}
    return Inspection(
        mesh,
        own,
        repaired.steps,
        measures,
        checksum=_checksum(mesh, own),
        solid=_checksum(mesh),
        likeness=_likeness(mesh),
        side_files=raw.side_files,
        lost=raw.lost,
    )


def file_from_object(mesh: Trimesh, up: UpAxis) -> NDArray[np.float64]:
    """The similarity (4, 4) from the object frame to that of the mesh: scale by its diagonal, turn, then move."""
    low_3, high_3 = mesh.bounds
    matrix = np.eye(4)
    matrix[:3, :3] = TURNS[up].T * np.linalg.norm(high_3 - low_3)
    matrix[:3, 3] = (low_3 + high_3) / 2
    return matrix


def _likeness(mesh: Trimesh) -> tuple[float, ...]:
    """Surface and principal moments of inertia, made free of place, turn and size by the volume."""
    moments = np.sort(np.asarray(mesh.principal_inertia_components, float)) / mesh.volume ** (5 / 3)
    return (float(mesh.area / mesh.volume ** (2 / 3)), *moments.tolist())


def _checksum(mesh: Trimesh, colors: NDArray[np.uint8] | None = None) -> str:
    value = crc32(mesh.vertices.tobytes() + mesh.faces.tobytes())
    return f"{value if colors is None else crc32(colors.tobytes(), value):08x}"
