"""The objects of a data set, before they are built."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from stereo_occ.config import PairsConfig
from stereo_occ.data.config import MeshesConfig, MeshFilesConfig, ProceduralConfig, ShapeNetConfig, SplitKind
from stereo_occ.data.meshes import MeshRecord, inspect_files, without_copies
from stereo_occ.data.splits import split_objects
from stereo_occ.errors import UserError
from stereo_occ.shapes.layouts import Listing, Skipped, UpAxis, list_folder, list_table
from stereo_occ.shapes.mesh_cache import MeshCache
from stereo_occ.shapes.procedural import procedural_shape
from stereo_occ.shapes.shape import Shape
from stereo_occ.shapes.shapenet import list_shapenet


@dataclass(frozen=True)
class ObjectSource:
    """One object of a data set and how to build it (picklable, so that any process can).

    Attributes:
        version: differs when a file of the same name holds another mesh; empty for a generated object.
        solid: of a mesh, the same for the same one in other colours.
        seed: of a generated object.
        subset: that the data set itself puts the object in; empty where it says nothing.
    """

    category: str
    object_id: str
    build: Callable[[], Shape]
    version: str = ""
    solid: str = ""
    subset: str = ""
    seed: int = 0

    @property
    def file_name(self) -> str:
        """Of its shard."""
        return f"{self.object_id}{self.version}.h5"

    @property
    def key(self) -> tuple[str, str]:
        """Category and id."""
        return self.category, self.object_id

    @property
    def identity(self) -> str:
        """The same for one shape in all data sets: the solid of a mesh file; seed and name of a generated object."""
        return self.solid or f"{self.seed}/{self.category}/{self.object_id}"


@dataclass(frozen=True)
class Objects:
    """What a data set holds.

    Attributes:
        skipped: files and folders that gave no object.
        records: of all mesh files, also those that were rejected; empty for generated objects.
    """

    sources: list[ObjectSource]
    skipped: list[Skipped] = field(default_factory=list)
    records: list[MeshRecord] = field(default_factory=list)


def list_objects(pairs: PairsConfig, progress: bool) -> Objects:
    """The objects of the asked categories, and the files that are no usable object.

    Meshes are read and repaired, unless they are in the cache under ``paths.data``.

    Raises:
        UserError: the folder is missing or not laid out as it should be.
    """
    data, categories = pairs.data, pairs.categories.names
    if isinstance(data, ProceduralConfig):
        return Objects(
            [
                ObjectSource(
                    category,
                    f"{category}_{index:04d}",
                    partial(procedural_shape, category, data.seed, index),
                    seed=data.seed,
                )
                for category in categories
                for index in range(data.counts[category])
            ]
        )
    assert isinstance(data, MeshFilesConfig)
    listing = _listing(data)
    files = [file for file in listing.files if file.category in categories]
    cache = MeshCache(Path(pairs.paths.data) / "mesh_cache", Path(data.root), data.colors)
    records = list(
        without_copies(
            inspect_files(files, cache, pairs.workers, data.time_limit, data.memory_limit, progress)
        )
    )
    skipped = listing.skipped + [
        Skipped(record.file.path, record.file.object_id, record.file.category, record.outcome.reason)
        for record in records
        if record.outcome.reason
    ]
    sources = [
        ObjectSource(
            record.file.category,
            record.file.object_id,
            record.shape,
            version=_version(record),
            solid=f"_{record.outcome.solid}",
            subset=record.file.subset,
        )
        for record in records
        if not record.outcome.reason
    ]
    return Objects(sources, skipped, records)


def members(objects: Sequence[ObjectSource], pairs: PairsConfig, subset: str) -> list[ObjectSource]:
    """The objects that ``train``, ``val``, ``test`` or ``all`` needs.

    Raises:
        UserError: there is none, or a category has fewer objects than subsets to fill.
    """
    if not objects:
        raise UserError(
            f"data={pairs.data.name}: no usable object of {', '.join(pairs.categories.names)}; "
            f"python -m stereo_occ.inspect with the same data says why"
        )
    if subset == "all" or pairs.data.split is SplitKind.view:
        return list(objects)
    by_key = {source.key: source for source in objects}
    given = {source.key: source.subset for source in objects if source.subset}
    division = split_objects(list(by_key), pairs.data.fractions, pairs.data.seed, given)
    if not division[subset]:
        raise UserError(
            f"data.name={pairs.data.name}: no object is in {subset}, by data.fractions={list(pairs.data.fractions)} or "
            f"the lists that the data set comes with; change these for a training, subset= for an evaluation"
        )
    return [by_key[key] for key in division[subset]]


def training_objects(objects: Sequence[ObjectSource], pairs: PairsConfig) -> dict[str, list[str]]:
    """Identities of the objects that a training learns from (``train``) and chooses by (``val``).

    Raises:
        UserError: as :func:`members`.
    """
    return {
        subset: sorted(source.identity for source in members(objects, pairs, subset))
        for subset in ("train", "val")
    }


def _version(record: MeshRecord) -> str:
    turned = "" if record.file.up is UpAxis.y else f"_{record.file.up.value}"
    return f"_{record.outcome.checksum}{turned}"


def _listing(data: MeshFilesConfig) -> Listing:
    root = Path(data.root)
    if isinstance(data, ShapeNetConfig):
        return list_shapenet(root)
    assert isinstance(data, MeshesConfig)
    return list_folder(root, data.up) if data.table is None else list_table(root, Path(data.table), data.up)
