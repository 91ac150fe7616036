"""Objects from a folder of meshes, one folder per object: ``category/name/model.*``."""

from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import trimesh
from tqdm import tqdm
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.shapes.shape import CATEGORIES, Shape

#: Mesh files that are read, the preferred first where an object has several.
SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".dae")

LAYOUT = f"CATEGORY/NAME/model.* with CATEGORY in {', '.join(CATEGORIES)} and one of {', '.join(SUFFIXES)}"


@dataclass(frozen=True)
class Skipped:
    """A file or folder that gave no object.

    Attributes:
        path: of the mesh file, or of the folder where that is what is wrong.
        object_id: name of the object's folder, empty for a whole category.
        category: as the folder is called.
        reason: why, in one line.
    """

    path: Path
    object_id: str
    category: str
    reason: str


def read_folder(root: Path) -> tuple[list[Shape], list[Skipped]]:
    """Every object of a folder that is a usable solid, in the object frame, and all that was left out.

    A mesh is usable if it is watertight and encloses a positive volume once vertices at the same place are
    merged. The parts of a scene are put in their places and joined, inverted meshes are turned outward,
    materials are not read. A file that cannot be read is skipped like any other.

    Args:
        root: with the layout ``category/name/model.*``; ``name`` becomes the object's id.

    Returns:
        The objects, and the skipped ones with the reason for each; both sorted by category and name.

    Raises:
        UserError: there is no such folder, or none of its folders is a category.
    """
    if not root.is_dir():
        raise UserError(f"mesh folder {root} does not exist: give a folder laid out as {LAYOUT}")
    folders = sorted(path for path in root.iterdir() if path.is_dir() and not path.name.startswith("."))
    if not any(folder.name in CATEGORIES for folder in folders):
        found = ", ".join(folder.name for folder in folders[:5]) or "no folders"
        raise UserError(f"mesh folder {root} holds no category ({found}): lay it out as {LAYOUT}")
    shapes: list[Shape] = []
    skipped: list[Skipped] = []
    for folder in folders:
        if folder.name not in CATEGORIES:
            skipped.append(Skipped(folder, "", folder.name, _unknown_category(folder.name)))
            continue
        for entry in tqdm(_entries(folder), desc=folder.name, unit="mesh", disable=None):
            path = entry
            try:
                path = _model_file(entry)
                shapes.append(_shape(path, folder.name))
            except UserError as error:
                skipped.append(Skipped(path, entry.name, folder.name, str(error)))
    return shapes, skipped


def read_solid(path: Path) -> Trimesh:
    """The mesh of a file as a watertight solid with outward winding, in the file's own frame; geometry only.

    Raises:
        UserError: the file cannot be read, or what it holds is not a solid; the message is the reason alone.
    """
    file_type = path.suffix.lower().removeprefix(".")
    if file_type not in trimesh.available_formats():
        raise UserError(
            f"reading {path.suffix} files needs pycollada: pip install pycollada, or convert it to .glb"
        )
    try:
        scene = trimesh.load_scene(path, process=False, skip_materials=True)
        mesh = scene.to_mesh()
    except Exception as error:  # a broken file makes the parsers fail in any way
        raise UserError(
            f"cannot be read: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
        ) from error
    if not len(mesh.faces):
        raise UserError("holds no triangles")
    if not np.isfinite(mesh.vertices).all():
        raise UserError("has vertices that are not finite numbers")
    mesh = Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces((np.diff(np.sort(mesh.faces, axis=1), axis=1) > 0).all(axis=1))
    mesh.remove_unreferenced_vertices()
    return _outward(mesh)


def _outward(mesh: Trimesh) -> Trimesh:
    """The mesh with consistent outward winding, or the reason why it is no solid."""
    _, uses = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    if not mesh.is_watertight:
        raise UserError(
            f"not watertight: of {len(uses)} edges {(uses == 1).sum()} border a hole "
            f"and {(uses > 2).sum()} join more than two faces"
        )
    if not mesh.is_winding_consistent:
        mesh.fix_normals(multibody=False)
    if not mesh.is_winding_consistent:
        raise UserError("its faces cannot all be turned outward (a one-sided surface)")
    with np.errstate(invalid="ignore"):  # trimesh divides by the volume for the centre of mass
        volume = mesh.volume
    if abs(volume) <= 1e-9 * mesh.scale**3:
        raise UserError(f"encloses no volume ({volume:.3g} in a box of diagonal {mesh.scale:.3g})")
    if volume < 0:
        mesh.invert()
    return mesh


def _shape(path: Path, category: str) -> Shape:
    mesh = read_solid(path)
    facts: dict[str, str | float | bool] = {
        "file": path.name,
        "faces": len(mesh.faces),
        "bodies": mesh.body_count,
    }
    return Shape(category, path.parent.name, mesh, facts=facts).normalized()


def _entries(folder: Path) -> list[Path]:
    """What should be an object: every folder, and every mesh file that is not in one."""
    entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    return [path for path in entries if path.is_dir() or path.suffix.lower() in SUFFIXES]


def _model_file(entry: Path) -> Path:
    """The mesh file of an object's folder."""
    if not entry.is_dir():
        raise UserError(f"lies beside the objects: move it to {entry.stem}/model{entry.suffix}")
    files = [path for path in sorted(entry.iterdir()) if path.suffix.lower() in SUFFIXES]
    models = [path for path in files if path.stem == "model"]
    if models:
        return min(models, key=lambda path: SUFFIXES.index(path.suffix.lower()))
    hint = (
        f"rename {files[0].name} to model{files[0].suffix}"
        if files
        else f"put one of {', '.join(SUFFIXES)} there"
    )
    raise UserError(f"has no file model.*: {hint}")


def _unknown_category(name: str) -> str:
    known = f"the categories are {', '.join(CATEGORIES)}"
    nearest = get_close_matches(name.lower(), CATEGORIES, n=1)
    return f"'{name}' is not a category: {f'rename it to {nearest[0]}; ' if nearest else ''}{known}"
