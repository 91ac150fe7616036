"""Schemas of the configuration group ``data``: which objects, how many views of each, how they are divided."""

from dataclasses import dataclass
from enum import Enum

from omegaconf import MISSING

from stereo_occ.shapes.layouts import UpAxis


class SplitKind(Enum):
    """What is held out."""

    object = "object"  # no object is in two splits
    view = "view"  # the paper's wording: the views of every object are divided


@dataclass
class SliceConfig:
    """Every ``of``-th object, beginning with number ``index``: what one of several machines renders."""

    index: int = 1  # 1 to of
    of: int = 1


@dataclass
class DataConfig:
    """Which objects, how many views of each, how they are divided."""

    name: str = MISSING
    seed: int = MISSING  # of objects, poses, appearances and point pools; apart from the seed of training
    views: int = MISSING
    image_side: int = MISSING
    pool_size: int = MISSING  # labelled points per pool and object
    split: SplitKind = MISSING
    fractions: list[float] = MISSING  # train, val, test; of categories that do not come divided


@dataclass
class ProceduralConfig(DataConfig):
    """Generated mugs, bowls and bottles."""

    name: str = "procedural"
    counts: dict[str, int] = MISSING


@dataclass
class MeshFilesConfig(DataConfig):
    """Mesh files in a folder; each is repaired where it can be, else left out."""

    root: str = MISSING
    colors: bool = True  # read the files' own colours and textures
    time_limit: float = 120.0  # seconds for reading and repairing one mesh
    memory_limit: float = 4.0  # GB for that


@dataclass
class MeshesConfig(MeshFilesConfig):
    """A folder of meshes, laid out by category or listed in a table."""

    name: str = "meshes"
    table: str | None = None  # CSV file with columns file and category; null: folders named after categories
    up: UpAxis = UpAxis.y  # of the files' axes; a table can say it of each


@dataclass
class ShapeNetConfig(MeshFilesConfig):
    """ShapeNetCore v1 or v2 as it is distributed."""

    name: str = "shapenet"


DATA_SCHEMAS: dict[str, type[DataConfig]] = {
    schema.name: schema for schema in (ProceduralConfig, MeshesConfig, ShapeNetConfig)
}

#: How a data set is found and read changes which objects there are, not what a shard holds.
NOT_CONTENT = ("counts", "split", "fractions", "table", "up", "colors", "time_limit", "memory_limit")
