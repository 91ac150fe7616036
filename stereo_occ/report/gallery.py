"""Rows of the galleries: the pair, the meshes of two models and the true one, of one object-view."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import acos, asin, atan2, cos, degrees, radians, sin
from pathlib import Path

import numpy as np
import trimesh
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image
from trimesh import Trimesh
from trimesh.graph import smooth_shade
from trimesh.visual.color import srgb_to_linear
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from stereo_occ.errors import UserError
from stereo_occ.evaluation_rows import Key
from stereo_occ.geometry.camera import Camera, StereoRig, intrinsics
from stereo_occ.kept_views import KeptView
from stereo_occ.pictures import LOOK, PANEL, picture
from stereo_occ.report.models import Model
from stereo_occ.report.selection import METRIC, Choice

TRUE_COLOR = "#8d949e"

#: Edges that bend by more are drawn as edges; radians.
_CREASE = 0.6


@dataclass(frozen=True, eq=False)
class Panel:
    """One mesh of a row; without faces there is nothing to show.

    Attributes:
        caption: what it is, with the IoU of a prediction.
    """

    caption: str
    color: str
    mesh: Trimesh

    @property
    def empty(self) -> bool:
        """Whether nothing was predicted."""
        return not len(self.mesh.faces)

    @property
    def glb(self) -> str:
        """The mesh as a GLB file in base64."""
        shaded = smooth_shade(self.mesh, angle=_CREASE)
        shade = np.rint(255 * srgb_to_linear(to_rgb(self.color))).astype(int).tolist()
        material = PBRMaterial(baseColorFactor=[*shade, 255], metallicFactor=0.0, roughnessFactor=0.75)
        shaded.visual = TextureVisuals(material=material)
        return base64.b64encode(shaded.export(file_type="glb", include_normals=True)).decode()


@dataclass(frozen=True, eq=False)
class GalleryRow:
    """An object-view: the two pictures, the panels (last the truth), and from where to look at them.

    Attributes:
        target: centre of the true mesh ``(3,)``, rig frame.
        orbit: azimuth and polar angle in degrees and distance of the left camera about the target, as model-viewer
            counts them.
        fov: vertical field of view in degrees in which every mesh of the row has room.
    """

    choice: Choice
    pictures: tuple[Image.Image, Image.Image]
    panels: list[Panel]
    target: NDArray[np.float64]
    orbit: tuple[float, float, float]
    fov: float

    def drawings(self) -> list[Image.Image]:
        """Each panel's mesh as model-viewer first shows it.

        Raises:
            UserError: OpenGL is not to be had.
        """
        camera = Camera(intrinsics(radians(self.fov), PANEL), self._camera_from_rig, PANEL, PANEL)
        rig = StereoRig(camera, camera)
        looks = [replace(LOOK, base_color_3=srgb_to_linear(to_rgb(panel.color))) for panel in self.panels]
        return [
            Image.fromarray(picture(panel.mesh, rig, look))
            for panel, look in zip(self.panels, looks, strict=True)
        ]

    @property
    def _camera_from_rig(self) -> NDArray[np.float64]:
        """Upright, looking at the target."""
        azimuth, polar, distance = radians(self.orbit[0]), radians(self.orbit[1]), self.orbit[2]
        right = np.array([cos(azimuth), 0, -sin(azimuth)])
        backward = np.array([sin(azimuth) * sin(polar), cos(polar), cos(azimuth) * sin(polar)])
        camera_from_rig_44 = np.eye(4)
        camera_from_rig_44[:3, :3] = right, np.cross(right, backward), -backward
        camera_from_rig_44[:3, 3] = [0, 0, distance] - camera_from_rig_44[:3, :3] @ self.target
        return camera_from_rig_44


def make_row(choice: Choice, kept: Sequence[KeptView], models: Sequence[tuple[Model, str]]) -> GalleryRow:
    """Read the files of one object-view.

    Args:
        kept: of the first seed of each model; the last one's picture is shown.
        models: with their colours, in the order of the panels.

    Raises:
        UserError: a file is damaged or missing.
    """
    panels = []
    for view, (model, color) in zip(kept, models, strict=True):
        iou = model.evaluations.values[METRIC][0, model.evaluations.keys.index(choice.key)]
        mesh = _mesh(view.mesh_file("predicted"))
        panels.append(Panel(f"{model.label}: IoU {iou:.2f}", color, mesh))
    true = _mesh(kept[-1].mesh_file("true"))
    panels.append(Panel("truth", TRUE_COLOR, true))
    pictures = _pair(kept[-1].pair_file)
    target = true.bounds.mean(axis=0) if len(true.faces) else np.zeros(3)
    x, y, z = kept[-1].rig.left.center - target
    distance = float(np.linalg.norm([x, y, z]))
    reach = max(
        (
            float(np.linalg.norm(panel.mesh.vertices - target, axis=1).max())
            for panel in panels
            if not panel.empty
        ),
        default=0.5,
    )
    fov = 2 * degrees(asin(min(0.9, 1.05 * reach / distance)))
    orbit = (degrees(atan2(x, z)), degrees(acos(y / distance)), distance)
    return GalleryRow(choice, pictures, panels, target, orbit, fov)


def title_of(key: Key) -> str:
    """An object-view by name."""
    return f"{key[1]}, view {key[2]}"


def data_uri(image: Image.Image) -> str:
    """A picture as ``data:`` address."""
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"


def _pair(path: Path) -> tuple[Image.Image, Image.Image]:
    try:
        with Image.open(path) as pair:
            side = pair.height
            left, right = (pair.convert("RGB").crop((x, 0, x + side, side)) for x in (0, pair.width - side))
            return left, right
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read; evaluate the checkpoint again") from error


def _mesh(path: Path | None) -> Trimesh:
    if path is None:
        return Trimesh()
    try:
        return trimesh.load_mesh(path)
    except Exception as error:  # whatever a damaged file makes of trimesh
        raise UserError(f"{path}: cannot be read; evaluate the checkpoint again") from error
