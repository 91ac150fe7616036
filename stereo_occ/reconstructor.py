"""A mesh in metres from one's own calibrated pair."""

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.visual import ColorVisuals

from stereo_occ.calibration import RealPair, read_calibration
from stereo_occ.config import TrainConfig
from stereo_occ.data.rigs import RectifiedRigConfig
from stereo_occ.decision import Decision
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import transform_points
from stereo_occ.mesh_output import collapsed, simplified
from stereo_occ.packaged import DEFAULT
from stereo_occ.photographs.color import vertex_colors
from stereo_occ.photographs.doubts import doubts
from stereo_occ.photographs.framing import Framing, frame_on_fixation, frame_on_object
from stereo_occ.photographs.given import ImageFile, Pair, both, locate_pair, photos_of
from stereo_occ.photographs.locate import Found
from stereo_occ.photographs.match import SIDES
from stereo_occ.photographs.outline import preview
from stereo_occ.photographs.views import views_of
from stereo_occ.reconstruction import expected_iou, sample_cube, threshold_of
from stereo_occ.trained import Predict, load_trained, with_mirror_image

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class SurfaceOptions:
    """How the surface is taken from the occupancy.

    Attributes:
        threshold: occupancy probability at the surface; None: what the checkpoint decides.
        resolution: cells along each side of the cube.
        steps: of the search for each vertex's true place.
        simplify: how far the surface may move for fewer faces, metres; None: not at all.
        color: take the vertices' colours from the photographs.
    """

    threshold: float | None = None
    resolution: int = 128
    steps: int = 1
    simplify: float | None = None
    color: bool = False


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """What was made of a pair.

    Attributes:
        mesh: closed, metres, left camera's frame (+X right, +Y down, +Z forward).
        left_from_cube: 4x4 similarity from the working cube, whose side is ``unit`` metres.
        threshold: occupancy probability at the surface.
        confidence: the IoU that the model itself expects, 0 to 1.
        doubts: what speaks against the answer, a line each.
        seconds: of each stage.
    """

    mesh: Trimesh
    left_from_cube: NDArray[np.float64]
    unit: float
    threshold: float
    confidence: float
    found: tuple[Found, Found] | None
    pair: RealPair
    images: tuple[NDArray[np.uint8], NDArray[np.uint8]]
    framing: Framing
    doubts: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def left_from_rig(self) -> NDArray[np.float64]:
        """4x4 rigid, metres, from the rig frame: the cube's centre, +X right, +Y up, +Z towards the cameras."""
        rigid = self.left_from_cube.copy()
        rigid[:3, :3] /= self.unit
        return rigid

    def mesh_in_rig(self) -> Trimesh:
        """The mesh in the rig frame, metres."""
        mesh = self.mesh.copy()
        mesh.apply_transform(np.linalg.inv(self.left_from_rig))
        return mesh

    def preview(self) -> NDArray[np.uint8]:
        """RGB: both photographs with the mesh's outline, and the parts of them that the model was given."""
        boxes = None if self.found is None else [part.box for part in self.found]
        below_a_pixel = collapsed(self.mesh, self.unit / 500)
        return preview(below_a_pixel, self.pair, self.images, boxes, self.framing.cameras)

    def description(self, mesh: Trimesh | None = None) -> dict[str, Any]:
        """Plain values for a JSON file, of the mesh or of the same in another frame."""
        mesh = self.mesh if mesh is None else mesh
        return {
            "unit": "m",
            "volume": float(mesh.volume),
            "area": float(mesh.area),
            "center": mesh.bounds.mean(axis=0).tolist(),
            "extents": mesh.extents.tolist(),
            "watertight": bool(mesh.is_watertight),
            "vertices": len(mesh.vertices),
            "faces": len(mesh.faces),
            "threshold": self.threshold,
            "confidence": self.confidence,
            "doubts": self.doubts,
            "left_from_rig": self.left_from_rig.tolist(),
            "left_from_cube": self.left_from_cube.tolist(),
            "cube_side": self.unit,
            "baseline": self.pair.baseline,
            "found": self.found
            and {
                side: {"how": part.how, "box": list(vars(part.box).values())}
                for side, part in zip(SIDES, self.found, strict=True)
            },
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
        }


class Reconstructor:
    """Reconstructs the object in calibrated pairs with one model.

    Args:
        config: of the model's training: how it wants to see a pair.
        predict: what the model says of a pair.
        decision: from which probability on a point counts as inside.
        name: of the checkpoint.
    """

    def __init__(self, config: TrainConfig, predict: Predict, decision: Decision, name: str) -> None:
        self.config, self.predict, self.decision, self.name = config, predict, decision, name

    @classmethod
    def from_checkpoint(
        cls, checkpoint: str | Path = DEFAULT, backend: str = "torch", threads: int | None = None
    ) -> Self:
        """Of a run's ``best.ckpt``, exported ``.safetensors``, or the name of shipped weights.

        Args:
            backend: ``torch``; or ``onnx``, for what ``python -m stereo_occ.export onnx=true`` wrote.
            threads: of ONNX Runtime; torch has ``torch.set_num_threads``.

        Raises:
            UserError: it cannot be read.
        """
        if backend == "onnx":
            from stereo_occ.onnx_model import load_onnx  # needs the extra onnx

            trained: Any = load_onnx(str(checkpoint), threads)
        else:
            trained = load_trained(str(checkpoint))
        return cls(trained.config, trained.predict, trained.decision, trained.name)

    def __call__(
        self,
        left: ImageFile,
        right: ImageFile,
        rig: RealPair | str | Path | Sequence[str | Path],
        *,
        boxes: Pair = (None, None),
        masks: Pair = (None, None),
        find: str | None = None,
        center: Sequence[float] | None = None,
        size: float | None = None,
        unit: str | float | None = None,
        rectified: bool = False,
        mirror: bool | None = None,
        surface: SurfaceOptions = SurfaceOptions(),
    ) -> Reconstruction:
        """The mesh of the object in a pair.

        Args:
            left, right: image files, Pillow's images, or RGB ``(H, W, 3)``.
            rig: calibration, or its files; see :func:`~stereo_occ.calibration.read_calibration`, also for ``unit``
                and ``rectified``.
            boxes: around the object in each image: left, top, right, bottom, pixels. One is enough.
            masks: image files or boolean ``(H, W)``, where the object is. One counts as its box. Without boxes and
                masks: the images' transparency, else what ``find`` finds, else ``center`` and ``size``, else what
                stands out from a plain background.
            find: mug, bowl or bottle: the likeliest one in the left image, by a detector that is fetched once.
            center: of the object ``(3,)``, left camera's frame, metres; triangulated if None.
            size: diagonal of the object's bounding box, metres; from the boxes if None.
            mirror: ask the model about the pair's mirror image too and take the mean, in twice the time; None: if its
                training had mirror images.

        Raises:
            UserError: for anything in this that the user can put right, or if nothing is found to be occupied.
        """
        seconds: dict[str, float] = {}
        with _timed(seconds, "read"):
            pair = rig if isinstance(rig, RealPair) else read_calibration(rig, unit, rectified)
            photos = photos_of(left, right)
            pair = pair.fitted((photos[0].size, photos[1].size))
        boxes, masks = both(boxes, "boxes"), both(masks, "masks")
        center_3 = None if center is None else _place(center)
        on_object = isinstance(self.config.rig, RectifiedRigConfig)
        with _timed(seconds, "locate"):
            shown = any(part is not None for part in (*boxes, *masks, find, *(p.mask_HW for p in photos)))
            required = on_object and (shown or center_3 is None or size is None)
            found = locate_pair(pair, photos, boxes, masks, find, required)
        with _timed(seconds, "frame"):
            framing = self._frame(pair, found, find, center_3, size)
            views = views_of(pair, photos, found, framing, self.config.background, self.name)
        with _timed(seconds, "encode"):
            both_ways = self.config.augmentation.mirror > 0 if mirror is None else mirror
            occupancy = (with_mirror_image(self.predict) if both_ways else self.predict)(views)
        with _timed(seconds, "extract"):
            threshold = (
                threshold_of(self.decision, occupancy) if surface.threshold is None else surface.threshold
            )
            field = sample_cube(occupancy, threshold, surface.resolution)
            mesh = field.surface(surface.steps)
        if not len(mesh.faces):
            raise UserError(
                f"nothing is occupied at a probability of {threshold:.3g}; check the boxes and the calibration with "
                f"the images, or lower threshold="
            )
        left_from_cube = np.asarray(np.linalg.inv(framing.cube_from_left), dtype=np.float64)
        mesh = Trimesh(transform_points(np.asarray(mesh.vertices), left_from_cube), mesh.faces, process=False)
        images = photos[0].rgb_HW3, photos[1].rgb_HW3
        with _timed(seconds, "finish"):
            # Slivers that marching cubes leaves would become holes when a file's single precision merges their corners.
            mesh = collapsed(mesh, 1e-3 * framing.unit / surface.resolution)
            if surface.simplify:
                mesh = simplified(mesh, surface.simplify)
            if surface.color:
                clearance = framing.unit / surface.resolution
                masks_2 = [None, None] if found is None else [part.mask_HW for part in found]
                colors_V3 = vertex_colors(mesh, pair, images, masks_2, clearance)
                mesh.visual = ColorVisuals(mesh, vertex_colors=colors_V3)
        return Reconstruction(
            mesh,
            left_from_cube,
            framing.unit,
            threshold,
            expected_iou(field),
            found,
            pair,
            images,
            framing,
            self._doubts(pair, found, framing),
            seconds,
        )

    def _frame(
        self,
        pair: RealPair,
        found: tuple[Found, Found] | None,
        find: str | None,
        center_3: NDArray[np.float64] | None,
        size: float | None,
    ) -> Framing:
        config, side = self.config.rig, self.config.data.image_side
        if isinstance(config, RectifiedRigConfig):
            return frame_on_object(pair, config, self.config.placement.kind, side, found, center_3, size)
        if any(part is not None for part in (find, center_3, size)):
            raise UserError(
                f"find, center, size: the checkpoint {self.name} looks at the whole view about the point where the "
                f"cameras' axes meet, so these have no effect; leave them out"
            )
        return frame_on_fixation(pair, config, side)

    def _doubts(self, pair: RealPair, found: tuple[Found, Found] | None, framing: Framing) -> list[str]:
        config = self.config.rig
        return doubts(pair, found, framing, config) if isinstance(config, RectifiedRigConfig) else []


def _place(center: Sequence[float]) -> NDArray[np.float64]:
    center_3 = np.asarray(center, dtype=np.float64)
    if center_3.shape != (3,) or not np.isfinite(center_3).all():
        raise UserError(f"center={center_3.tolist()}: must be [x,y,z] in metres")
    return center_3


@contextmanager
def _timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[name] = time.perf_counter() - start
