"""What of glTF files is not read, so that nobody gets another shape than the file's."""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

#: Extensions that keep triangles in a form of their own.
DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"

#: Attributes whose integers may stand for fractions; trimesh takes them for whole numbers.
PLACES = ("POSITION", "TEXCOORD_0")


def unread(path: Path) -> str:
    """Why a glTF file cannot be read right, empty where it can, or is none."""
    try:
        scene = _scene(path)
        used = scene.get("extensionsUsed", [])
        if DRACO in used and find_spec("DracoPy") is None:
            return f"is compressed ({DRACO}): pip install DracoPy, or export it without"
        if MESHOPT in used:
            return f"is compressed ({MESHOPT}), which is not read: export it without"
        if _has_fractions(scene):
            return "keeps places as normalised integers, which are not read: gltf-transform dequantize writes numbers"
    except (ValueError, TypeError, KeyError, IndexError, AttributeError):
        pass  # whoever reads it says what is wrong
    return ""


def _scene(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        head = file.read(20)
        # Binary files begin with 12 bytes, length and kind of the first chunk; their buffers are the next.
        binary = head[:4] == b"glTF"
        content = file.read(int.from_bytes(head[12:16], "little")) if binary else head + file.read()
    scene: dict[str, Any] = json.loads(content)
    return scene


def _has_fractions(scene: dict[str, Any]) -> bool:
    return any(
        scene["accessors"][primitive["attributes"][name]].get("normalized", False)
        for mesh in scene.get("meshes", [])
        for primitive in mesh["primitives"]
        for name in PLACES
        if name in primitive["attributes"]
    )
