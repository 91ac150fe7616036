"""Which files of a folder are objects, and of which category."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum
from pathlib import Path, PurePath

from stereo_occ.errors import UserError
from stereo_occ.printable import printable
from stereo_occ.shapes.shape import CATEGORIES

SUBSETS = ("train", "val", "test")

#: Mesh files that are read, the preferred first where an object has several.
SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".dae")

LAYOUT = (
    f"CATEGORY/NAME/model.* or CATEGORY/NAME.* with CATEGORY in {', '.join(CATEGORIES)} "
    f"and one of {', '.join(SUFFIXES)}"
)

COLUMNS = "file (relative to data.root), category, and if you like name, subset and up"

#: File names that say nothing of the object: its folder's name does.
PLAIN_STEMS = ("model", "models", "model_normalized")


class UpAxis(Enum):
    """The axis of a file's frame that points up when the object stands."""

    y = "y"  # of glTF, and of most models made to be looked at
    z = "z"  # of URDF and most scans


@dataclass(frozen=True)
class MeshFile:
    """A file that should be an object.

    Attributes:
        object_id: unique within its category; part of file names.
        subset: one of :data:`SUBSETS` where the data set comes divided, else empty.
    """

    path: Path
    category: str
    object_id: str
    subset: str = ""
    up: UpAxis = UpAxis.y


@dataclass(frozen=True)
class Skipped:
    """A file or folder that gave no object.

    Attributes:
        path: of the mesh file, or of the folder where that is what is wrong.
        object_id: its name, empty for a whole category.
        category: as the folder is called.
        reason: why, in one line.
    """

    path: Path
    object_id: str
    category: str
    reason: str


@dataclass(frozen=True)
class Listing:
    """The files of a data set that should be objects, and what is not even that; sorted by category and name."""

    files: list[MeshFile]
    skipped: list[Skipped]


def list_folder(root: Path, up: UpAxis = UpAxis.y) -> Listing:
    """The files of a folder laid out as ``category/name/model.*`` or ``category/name.*``, or both.

    A folder with a single mesh may call it as it likes.

    Raises:
        UserError: there is no such folder, or none of its folders is a category.
    """
    folders = sorted(path for path in _existing(root).iterdir() if path.is_dir() and not _hidden(path))
    if not any(folder.name in CATEGORIES for folder in folders):
        found = ", ".join(folder.name for folder in folders[:5]) or "no folders"
        raise UserError(f"data.root={root}: holds no category ({found}); lay it out as {LAYOUT}")
    files: list[MeshFile] = []
    skipped: list[Skipped] = []
    for folder in folders:
        if folder.name not in CATEGORIES:
            skipped.append(_skipped(folder, "", folder.name, _unknown_category(folder.name)))
            continue
        taken: set[str] = set()
        for entry, name, candidates in _entries(folder):
            try:
                path = min(_models(entry, candidates), key=_preference)
                if not str(path.relative_to(root)).isprintable():
                    raise UserError("its name holds line breaks, or bytes that are no UTF-8: rename it")
                if name in taken:
                    raise UserError(f"another mesh beside it is called {name} too: rename one of them")
            except UserError as error:
                skipped.append(_skipped(entry, name, folder.name, str(error)))
            else:
                taken.add(name)
                files.append(MeshFile(path, folder.name, name, up=up))
    return Listing(files, skipped)


def list_table(root: Path, table: Path, up: UpAxis = UpAxis.y) -> Listing:
    """The files that a CSV file names: columns ``file`` and ``category``, optionally ``name``, ``subset`` and ``up``.

    Without a name it is the file's, or its folder's where the file is called ``model.*``. Where there is a column
    ``subset``, rows that leave it empty are skipped; where ``up`` is empty, it is the argument.

    Raises:
        UserError: the table cannot be read, or a row leads out of ``root``, repeats a name or names an unknown subset
            or axis.
    """
    where = f"data.table={table}"
    files: dict[tuple[str, str], MeshFile] = {}
    skipped: list[Skipped] = []
    divided = False
    for number, row in _rows(_existing(root), table):
        name = row.get("name") or _name(PurePath(row["file"]))
        path = root / _inside(row["file"], f"{where}, row {number}")
        subset = row.get("subset")
        axis = row.get("up") or up.value
        if axis not in UpAxis.__members__:
            raise UserError(
                f"{where}, row {number}: up={axis!r} must be {' or '.join(UpAxis.__members__)}, or empty"
            )
        file = MeshFile(path, row["category"], name, subset or "", UpAxis[axis])
        if _hidden(PurePath(name)) or not name.isprintable() or "/" in name or "\\" in name:
            raise UserError(
                f"{where}, row {number}: name {name!r} cannot be part of a file name; choose another"
            )
        if subset and subset not in SUBSETS:
            raise UserError(
                f"{where}, row {number}: subset={subset!r} must be one of {', '.join(SUBSETS)}, or empty"
            )
        if (former := files.get((file.category, name))) is not None:
            raise UserError(
                f"{where}, row {number}: {printable(file.category)}/{name} is {former.path.name} already; "
                f"give each its own in a column called name"
            )
        files[file.category, name] = file
        divided |= bool(subset)
    kept = []
    for file in sorted(files.values(), key=lambda file: (file.category, file.object_id)):
        if reason := _fault_of_row(file, divided):
            skipped.append(_skipped(file.path, file.object_id, file.category, reason))
        else:
            kept.append(file)
    return Listing(kept, skipped)


def _existing(root: Path) -> Path:
    if not root.is_dir():
        raise UserError(f"data.root={root}: no such folder; give one laid out as {LAYOUT}")
    return root


def _skipped(path: Path, object_id: str, category: str, reason: str) -> Skipped:
    return Skipped(Path(printable(str(path))), printable(object_id), printable(category), reason)


def _hidden(path: PurePath) -> bool:
    return path.name.startswith(".")


def _preference(path: Path) -> int:
    return SUFFIXES.index(path.suffix.lower())


def _is_mesh(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not _hidden(path)


def _entries(folder: Path) -> Iterator[tuple[Path, str, list[Path]]]:
    """What should be an object of a category: its folder or first file, its name and its meshes."""
    loose: dict[str, list[Path]] = {}
    for entry in sorted(folder.iterdir()):
        if entry.is_dir() and not _hidden(entry):
            yield entry, entry.name, sorted(path for path in entry.iterdir() if _is_mesh(path))
        elif _is_mesh(entry):
            loose.setdefault(entry.stem, []).append(entry)
    for name, paths in loose.items():
        yield paths[0], name, paths


def _models(entry: Path, candidates: list[Path]) -> list[Path]:
    """The files of one object among the meshes of its folder."""
    models = [path for path in candidates if path.stem == "model"]
    if models:
        return models
    if not candidates:
        raise UserError(f"holds no mesh: put one of {', '.join(SUFFIXES)} there")
    if len({path.stem for path in candidates}) > 1:
        names = ", ".join(path.name for path in candidates[:3])
        raise UserError(f"holds several meshes ({names}): call the one to use model{candidates[0].suffix}")
    return candidates


def _unknown_category(name: str) -> str:
    known = f"the categories are {', '.join(CATEGORIES)}"
    nearest = get_close_matches(name.lower(), CATEGORIES, n=1)
    return f"{name!r} is not a category: {f'rename it to {nearest[0]}; ' if nearest else ''}{known}"


def _rows(root: Path, table: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Rows with their numbers in the file, values without surrounding blanks."""
    try:
        with table.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, restval="", strict=True)  # strict: of quotes
            names = [name.strip().lower() for name in reader.fieldnames or ()]
            missing = [name for name in ("file", "category") if name not in names]
            if missing:
                found = printable(", ".join(names)) or "none"
                raise UserError(
                    f"data.table={table}: has no column {' and no '.join(missing)} but {found}; "
                    f"its columns are {COLUMNS}, separated by commas"
                )
            reader.fieldnames = names
            for row in reader:
                yield reader.line_num, {key: value.strip() for key, value in row.items() if key is not None}
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(
            f"data.table={table}: cannot be read ({error}); give a CSV file with {COLUMNS}"
        ) from error


def _inside(file: str, where: str) -> PurePath:
    """The relative path of a row, refused if it leads out of the folder."""
    path = PurePath(file)
    if not file or path.is_absolute() or ".." in path.parts or "\0" in file:
        raise UserError(f"{where}: file={file!r} must be a path below data.root, without '..'")
    return path


def _name(path: PurePath) -> str:
    if path.stem in PLAIN_STEMS and path.parent.name:
        return _name(path.parent)
    return path.stem if path.suffix.lower() in SUFFIXES else path.name


def _fault_of_row(file: MeshFile, divided: bool) -> str | None:
    if file.category not in CATEGORIES:
        return _unknown_category(file.category)
    if file.path.suffix.lower() not in SUFFIXES:
        return f"is no mesh file: known are {', '.join(SUFFIXES)}"
    if not file.path.is_file():
        return "does not exist"
    if divided and not file.subset:
        return "is in no subset"
    return None
