"""Mesh files for tests."""

from pathlib import Path

import numpy as np
import trimesh

from stereo_occ.shapes.inspection import inspect_mesh
from stereo_occ.shapes.layouts import Listing
from stereo_occ.shapes.shape import Shape


def box(x: float, y: float, z: float) -> trimesh.Trimesh:
    return trimesh.creation.box((x, y, z))


def put(mesh: trimesh.Trimesh | trimesh.Scene, root: Path, place: str) -> Path:
    """Write a mesh below ``root``, in the format of its suffix."""
    path = root / place
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".gltf":
        scene = mesh if isinstance(mesh, trimesh.Scene) else trimesh.Scene(mesh)
        for name, content in trimesh.exchange.gltf.export_gltf(scene).items():
            (path.parent / name.replace("model.gltf", path.name)).write_bytes(content)
    else:
        mesh.export(path)
    return path


def shapes_of(root: Path, listing: Listing, colors: bool = True) -> tuple[list[Shape], dict[str, str]]:
    """The objects of a listing, and the reason by id for each that was rejected; read in this process."""
    inspected = {file: inspect_mesh(file.path, root, colors) for file in listing.files}
    shapes = [inspection.shape(file) for file, inspection in inspected.items() if not inspection.reason]
    return shapes, {file.object_id: found.reason for file, found in inspected.items() if found.reason}


def sheet_of(mesh: trimesh.Trimesh, rng: np.random.Generator, specks: int) -> trimesh.Trimesh:
    """A mesh with defects of ShapeNet: every face doubled back to back, a third flipped, thousands of specks."""
    faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1]])
    flipped = rng.random(len(faces)) < 1 / 3
    faces[flipped] = faces[flipped][:, ::-1]
    corners_N33 = rng.uniform(-1, 1, (specks, 1, 3)) * mesh.extents / 4 + mesh.bounds.mean(axis=0)
    specks_N33 = corners_N33 + 1e-4 * mesh.scale * rng.standard_normal((specks, 3, 3))
    return trimesh.Trimesh(
        np.concatenate([mesh.vertices, specks_N33.reshape(-1, 3)]),
        np.concatenate([faces, len(mesh.vertices) + np.arange(3 * specks).reshape(-1, 3)]),
        process=False,
    )
