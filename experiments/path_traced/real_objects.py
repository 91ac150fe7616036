"""The real objects, upright and with the colours that they have of their own."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.config import TrainConfig
from stereo_occ.data.objects import ObjectSource, list_objects, members
from stereo_occ.shapes.shape import Shape

#: Which of the files is which object, and its axis that points up.
TABLE = Path(__file__).parents[1] / "real_objects" / "objects.csv"


def real_objects(root: Path) -> list[ObjectSource]:
    """Those of :data:`TABLE` in a folder; an object's number is its place here."""
    overrides = ["data=meshes", f"data.root={root}", f"data.table={TABLE}", "workers=1"]
    config = OmegaConf.to_object(compose_config("train", overrides))
    assert isinstance(config, TrainConfig)
    return members(list_objects(config, progress=True).sources, config, "all")


def own(source: ObjectSource) -> Shape:
    """The object; colours that are one grey are a file's default, so none of its own."""
    shape = source.build()
    if shape.colors is None or np.ptp(shape.colors):
        return shape
    return replace(shape, colors=None)


def others(sources: Sequence[ObjectSource], number: int, rng: np.random.Generator) -> Shape:
    """One of the objects that is not the one with that number."""
    return own(sources[(number + int(rng.integers(1, len(sources)))) % len(sources)])
