"""ShapeNetCore as it is distributed: ``synset/model_id/...``, version 1 or 2, with or without lists of subsets."""

from pathlib import Path

from stereo_occ.errors import UserError
from stereo_occ.shapes.layouts import SUBSETS, Listing, MeshFile, Skipped

#: Folders of ShapeNetCore by category; the names are lemmas of the WordNet synsets.
SYNSETS = {"bottle": "02876657", "bowl": "02880940", "mug": "03797390"}

#: Where a model's mesh is in version 2, and in version 1.
MODELS = ("models/model_normalized.obj", "model.obj")


def list_shapenet(root: Path) -> Listing:
    """The models of the known categories.

    A category with ``train.lst``, ``val.lst`` or ``test.lst`` (one model id per line) in ``splits/synset``,
    ``splits/category`` or beside its models is divided as they say; models in none of them are skipped.

    Raises:
        UserError: there is no folder of a known category, or a model is in two lists.
    """
    if not root.is_dir():
        raise UserError(
            f"data.root={root}: no such folder; give that of ShapeNetCore, which holds 03797390 (mug)"
        )
    present = {category: root / synset for category, synset in SYNSETS.items() if (root / synset).is_dir()}
    if not present:
        raise UserError(f"data.root={root}: {_where_else(root)}")
    files: list[MeshFile] = []
    skipped: list[Skipped] = []
    for category, folder in sorted(present.items()):
        lists = _lists(root, category)
        for entry in sorted(
            path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")
        ):
            path = next((entry / name for name in MODELS if (entry / name).is_file()), None)
            if path is None:
                skipped.append(Skipped(entry, entry.name, category, f"has neither {' nor '.join(MODELS)}"))
            elif lists and entry.name not in lists:
                skipped.append(Skipped(path, entry.name, category, "is in no list of the splits"))
            else:
                files.append(MeshFile(path, category, entry.name, lists.get(entry.name, "")))
        for model_id in sorted(set(lists) - {path.name for path in folder.iterdir()}):
            reason = f"is in {lists[model_id]}.lst, but the folder is not there"
            skipped.append(Skipped(folder / model_id, model_id, category, reason))
    return Listing(files, skipped)


def _lists(root: Path, category: str) -> dict[str, str]:
    """The subset of each listed model; empty where there are no lists."""
    synset = SYNSETS[category]
    for folder in (root / "splits" / synset, root / "splits" / category, root / synset):
        paths = [folder / f"{subset}.lst" for subset in SUBSETS]
        if any(path.is_file() for path in paths):
            return _subsets([path for path in paths if path.is_file()])
    return {}


def _subsets(paths: list[Path]) -> dict[str, str]:
    subsets: dict[str, str] = {}
    for path in paths:
        try:
            lines = path.read_text(encoding="utf-8").split()
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(
                f"{path}: cannot be read ({error}); it should hold one model id per line"
            ) from error
        for model_id in dict.fromkeys(lines):
            if model_id in subsets:
                raise UserError(
                    f"{path}: {model_id} is in {subsets[model_id]}.lst too; an object belongs to one subset"
                )
            subsets[model_id] = path.stem
    return subsets


def _where_else(root: Path) -> str:
    known = ", ".join(f"{synset} ({category})" for category, synset in SYNSETS.items())
    for folder in sorted(path for path in root.iterdir() if path.is_dir()):
        if any((folder / synset).is_dir() for synset in SYNSETS.values()):
            return f"the models are a level deeper; say data.root={folder}"
    return (
        f"holds none of {known}; give the folder of ShapeNetCore, or say data=meshes for a folder of your own"
    )
