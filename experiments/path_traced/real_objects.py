"""The real objects, upright."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf
from trimesh import Trimesh

from stereo_occ.cli import compose_config
from stereo_occ.config import TrainConfig
from stereo_occ.data.objects import ObjectSource, list_objects, members
from stereo_occ.shapes.shape import Shape

#: Objects whose files have +Z up; the others have +Y up.
Z_UP = {
    "cram_bottle", "pybullet_object_models_ycbmustardbottle", "pybullet_urdf_models_bleach_cleanser", "pyrender_fuze",
    "cram_bowl_pp", "gazebo_models_bowl", "prl_assets_plastic_bowl", "pybullet_urdf_models_bowl",
    "bullet3_mug", "cram_mug", "pybullet_urdf_models_mug",
}  # fmt: skip

Y_FROM_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def real_objects(root: Path) -> list[ObjectSource]:
    """Those in a folder as docs/own-meshes.md describes it; an object's number is its place here."""
    config = OmegaConf.to_object(compose_config("train", ["data=meshes", f"data.root={root}", "workers=1"]))
    assert isinstance(config, TrainConfig)
    return members(list_objects(config, progress=True).sources, config, "all")


def upright(source: ObjectSource) -> Shape:
    """The object in its frame with +Y up; colours that are one grey are a file's default, so none of its own."""
    shape = source.build()
    colors_V3 = shape.colors
    if colors_V3 is not None and not np.ptp(colors_V3):
        shape = replace(shape, colors=None)
    if source.object_id in Z_UP:
        mesh = Trimesh(shape.mesh.vertices @ Y_FROM_Z.T, shape.mesh.faces, process=False)
        shape = replace(shape, mesh=mesh)
    return shape


def others(sources: Sequence[ObjectSource], number: int, rng: np.random.Generator) -> Shape:
    """One of the objects that is not the one with that number."""
    return upright(sources[(number + int(rng.integers(1, len(sources)))) % len(sources)])
