"""What became of each mesh of a data set: a table and sheets of pictures to look through."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from math import pi
from pathlib import Path
from textwrap import shorten, wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation
from tqdm import tqdm
from trimesh import Trimesh

from stereo_occ.data.meshes import MeshRecord
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.occupancy.contains import contains
from stereo_occ.pictures import PANEL, picture
from stereo_occ.shapes.inspection import Inspection, file_from_object
from stereo_occ.writing import whole_file

COLUMNS, ROWS = 5, 12  # cells of a page
PANEL_SIDE = 150  # pixels
CELL_WIDTH, CELL_HEIGHT, MARGIN, HEADER = 2 * PANEL_SIDE + 12, PANEL_SIDE + 78, 6, 28
COLORS = {"clean": (40, 120, 60), "repaired": (170, 110, 0), "rejected": (180, 30, 30)}

#: Seen from the diagonal, an opening towards +Y and one towards +Z both show.
VIEW = Rotation.from_euler("yx", [-35, 30], degrees=True).as_matrix()


def write_quality_report(folder: Path, records: Sequence[MeshRecord], root: Path, progress: bool) -> None:
    """Write ``quality.csv`` and ``quality.png`` (``quality_2.png``, ... where there are more than fit).

    The table has a row for each mesh file with its status, repair or reason, and all figures. A cell of the sheet has
    a picture of the mesh, turned upright, and a section through the middle across X, solid black.

    Raises:
        UserError: the files cannot be written or OpenGL cannot be started.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_table(folder / "quality.csv", records, root)
        for stale in folder.glob("quality_*.png"):
            stale.unlink()
        bar: tqdm[Any] = tqdm(total=len(records), desc="drawing meshes", unit="mesh", disable=not progress)
        with bar:
            for page, start in enumerate(range(0, len(records), COLUMNS * ROWS), start=1):
                sheet = _page(records[start : start + COLUMNS * ROWS], _summary(records), bar)
                name = "quality.png" if page == 1 else f"quality_{page}.png"
                with whole_file(folder / name) as file:
                    sheet.quantize(128).save(file, "PNG", optimize=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error}); give another folder") from error


def _write_table(path: Path, records: Sequence[MeshRecord], root: Path) -> None:
    figures = sorted({name for record in records for name in record.outcome.measures})
    head = ["file", "category", "name", "subset", "up", "status", "repair", "lost", "reason"]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, [*head, *figures], restval="")
    writer.writeheader()
    for record in records:
        mesh_file, outcome = record.file, record.outcome
        names = (mesh_file.path.relative_to(root).as_posix(), mesh_file.category, mesh_file.object_id)
        texts = (
            mesh_file.subset,
            mesh_file.up.value,
            outcome.status,
            "; ".join(outcome.steps),
            "; ".join(outcome.lost),
            outcome.reason,
        )
        measures = {name: f"{round(value, 6):g}" for name, value in outcome.measures.items()}
        writer.writerow(dict(zip(head, (*names, *texts), strict=True)) | measures)
    with whole_file(path) as file:
        file.write(text.getvalue().encode("utf-8"))


def _summary(records: Sequence[MeshRecord]) -> str:
    counts = Counter(record.outcome.status for record in records)
    found = ", ".join(f"{counts[status]} {status}" for status in COLORS if counts[status])
    return f"{len(records)} meshes: {found}. Lengths in % of the bounding box's diagonal."


def _page(records: Sequence[MeshRecord], header: str, bar: "tqdm[Any]") -> Image.Image:
    rows = -(-len(records) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * CELL_WIDTH + MARGIN, HEADER + rows * CELL_HEIGHT), "white")
    draw = ImageDraw.Draw(sheet)
    draw.text((MARGIN, MARGIN), header, fill="black", font=ImageFont.load_default(14))
    for index, record in enumerate(records):
        row, column = divmod(index, COLUMNS)
        x, y = MARGIN + column * CELL_WIDTH, HEADER + row * CELL_HEIGHT
        outcome = record.load()
        if outcome.mesh is not None and np.ptp(outcome.mesh.bounds, axis=0).any():
            mesh = outcome.mesh.apply_transform(np.linalg.inv(file_from_object(outcome.mesh, record.file.up)))
            sheet.paste(_photograph(mesh), (x, y))
            if mesh.is_volume:
                sheet.paste(_section(mesh), (x + PANEL_SIDE, y))
        _caption(draw, x, y + PANEL_SIDE, record)
        bar.update()
    return sheet


def _caption(draw: ImageDraw.ImageDraw, x: int, y: int, record: MeshRecord) -> None:
    font = ImageFont.load_default(11)
    status = record.outcome.status
    name = shorten(f"{record.file.category}/{record.file.object_id}", 48, placeholder="...")
    lines = [status + _figures(record.outcome)]
    told = record.outcome.reason or "; ".join([*record.outcome.steps, *record.outcome.lost])
    lines += wrap(told, 54, max_lines=3, placeholder=" ...")
    draw.text((x, y), name, fill="black", font=font)
    for number, line in enumerate(lines, start=1):
        draw.text((x, y + 14 * number), line, fill=COLORS[status], font=font)


def _figures(outcome: Inspection) -> str:
    """Wall and deviation in words, for the outcomes that have them."""
    measures = outcome.measures
    if outcome.reason or "wall_median" not in measures:
        return ""
    farthest = max(measures["lost_p99"], measures["gained_p99"])
    return f": wall {100 * measures['wall_median']:.1f} %, deviation {100 * farthest:.2f} %"


def _photograph(mesh: Trimesh) -> Image.Image:
    rig = toed_in_rig(distance=1.0, half_angle=pi / 16, fov=pi / 3, side=PANEL)
    pose = np.eye(4)
    pose[:3, :3] = VIEW
    return Image.fromarray(picture(mesh.copy().apply_transform(pose), rig)).resize((PANEL_SIDE, PANEL_SIDE))


def _section(mesh: Trimesh) -> Image.Image:
    """The plane of Y and Z through the middle, +Y up: black where the object is solid."""
    across = (np.arange(2 * PANEL_SIDE) + 0.5) / (2 * PANEL_SIDE) - 0.5
    y_HW, z_HW = np.meshgrid(-across, across, indexing="ij")
    points_N3 = np.stack([np.full(y_HW.size, 1e-4), y_HW.ravel(), z_HW.ravel()], axis=1)
    solid_HW: NDArray[np.bool_] = contains(mesh, points_N3).reshape(y_HW.shape)
    grey = Image.fromarray(np.where(solid_HW, 0, 240).astype(np.uint8))
    return grey.resize((PANEL_SIDE, PANEL_SIDE), Image.Resampling.BOX)
