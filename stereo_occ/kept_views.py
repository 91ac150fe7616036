"""Meshes and pictures of views that an evaluation keeps in its folder ``views``, for the report.

``index.json`` lists them; beside it, for each, are under its ``name``:
    NAME_pair.png: left and right picture, as the network saw them.
    NAME_true.glb, NAME_predicted.glb: in the rig frame, with few faces, for show; an empty mesh has no file.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera, StereoRig
from stereo_occ.mesh_output import few_faces
from stereo_occ.models.base import StereoViews
from stereo_occ.predictors import ObjectView
from stereo_occ.writing import whole_file, write_json

FOLDER, INDEX = "views", "index.json"

#: Of a mesh that is kept.
MOST_FACES = 4000


@dataclass(frozen=True, eq=False)
class KeptView:
    """One kept view; its files start with ``path``."""

    category: str
    object_id: str
    view: int
    path: Path
    rig: StereoRig

    @property
    def key(self) -> tuple[str, str, int]:
        """Category, object, view."""
        return self.category, self.object_id, self.view

    def mesh_file(self, kind: str) -> Path | None:
        """The GLB of ``predicted`` or ``true``; None if that mesh is empty."""
        path = self._file(f"{kind}.glb")
        return path if path.is_file() else None

    @property
    def pair_file(self) -> Path:
        """The PNG with both pictures."""
        return self._file("pair.png")

    def _file(self, ending: str) -> Path:
        return self.path.with_name(f"{self.path.name}_{ending}")


class ViewKeeper:
    """Writes views as they are measured, and at the end their index."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / FOLDER
        self.entries: list[dict[str, Any]] = []

    def keep(self, view: ObjectView, picture: StereoViews, predicted: Trimesh, true: Trimesh) -> None:
        """Write one view; ``picture`` is what the predictor saw of it (``B = 1``), meshes are in the rig frame."""
        shard, rig = view.shard, view.rig
        name = f"{shard.category}/{shard.object_id}_view{view.view}"
        kept = KeptView(shard.category, shard.object_id, view.view, self.folder / name, rig)
        kept.path.parent.mkdir(parents=True, exist_ok=True)
        for kind, mesh in (("predicted", predicted), ("true", true)):
            path = kept._file(f"{kind}.glb")
            path.unlink(missing_ok=True)  # of a former evaluation
            if len(mesh.faces):
                with whole_file(path) as file:
                    few_faces(mesh, MOST_FACES).export(file, file_type="glb")
        pair_CHW = np.concatenate([picture.left_BCHW[0].numpy(), picture.right_BCHW[0].numpy()], axis=2)
        pair_HWC = (pair_CHW.clip(0, 1) * 255).round().astype(np.uint8).transpose(1, 2, 0)
        with whole_file(kept.pair_file) as file:
            Image.fromarray(pair_HWC).save(file, "PNG")
        self.entries.append(
            {
                "name": name,
                "category": shard.category,
                "object_id": shard.object_id,
                "view": view.view,
                "side": rig.left.width,
                "K": [camera.K.tolist() for camera in rig.cameras],
                "camera_from_rig": [camera.camera_from_rig.tolist() for camera in rig.cameras],
            }
        )

    def write_index(self) -> None:
        """Say what was kept, if anything was; what a former evaluation kept here counts no more."""
        if self.entries:
            write_json(self.folder / INDEX, self.entries)
        else:
            (self.folder / INDEX).unlink(missing_ok=True)


def read_kept_views(folder: Path) -> dict[tuple[str, str, int], KeptView]:
    """The kept views of an evaluation's folder by category, object and view; none if there is no index.

    Raises:
        UserError: the index is damaged.
    """
    index = folder / FOLDER / INDEX
    if not index.is_file():
        return {}
    try:
        views = [_read(entry, folder / FOLDER) for entry in json.loads(index.read_text())]
    except (OSError, ValueError, KeyError, TypeError, UserError) as error:
        raise UserError(f"{index}: is damaged; evaluate the checkpoint again") from error
    return {view.key: view for view in views}


def _read(entry: dict[str, Any], folder: Path) -> KeptView:
    cameras = [
        Camera(_array(K_33), _array(camera_from_rig_44), entry["side"], entry["side"])
        for K_33, camera_from_rig_44 in zip(entry["K"], entry["camera_from_rig"], strict=True)
    ]
    path = folder / entry["name"]
    return KeptView(entry["category"], entry["object_id"], entry["view"], path, StereoRig(*cameras))


def _array(values: Any) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)
