"""The objects of a data set, before they are built."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from zlib import crc32

from stereo_occ.config import DataConfig, MeshesConfig, ProceduralConfig
from stereo_occ.errors import UserError
from stereo_occ.shapes.folder import Skipped, read_folder
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import Shape


@dataclass(frozen=True)
class ObjectSource:
    """One object of a data set and how to build it (picklable, so that any process can).

    Attributes:
        version: differs when a file of the same name holds another mesh.
    """

    category: str
    object_id: str
    build: Callable[[], Shape]
    version: str = ""

    @property
    def file_name(self) -> str:
        """Of its shard."""
        return f"{self.object_id}{self.version}.h5"


def list_objects(data: DataConfig, categories: list[str]) -> tuple[list[ObjectSource], list[Skipped]]:
    """The objects of the asked categories, and the files that are no usable object.

    Raises:
        UserError: the folder is missing or holds no usable object.
    """
    if isinstance(data, ProceduralConfig):
        return [
            ObjectSource(
                category, f"{category}_{index:04d}", partial(procedural_shape, category, data.seed, index)
            )
            for category in categories
            for index in range(data.counts[category])
        ], []
    assert isinstance(data, MeshesConfig)
    shapes, skipped = read_folder(Path(data.root))
    sources = [
        ObjectSource(shape.category, shape.object_id, partial(_built, shape), _version(shape))
        for shape in shapes
        if shape.category in categories
    ]
    if not sources:
        raise UserError(
            f"data.root={data.root}: no watertight mesh of {', '.join(categories)} among {len(skipped)} files; "
            f"the layout is category/name/model.*"
        )
    return sources, skipped


def _built(shape: Shape) -> Shape:
    return shape


def _version(shape: Shape) -> str:
    return f"_{crc32(shape.mesh.vertices.tobytes() + shape.mesh.faces.tobytes()):08x}"
