"""Checkpoints, weights, shards and folders that no command can take, and what is said of each."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch
from bad_pairs import Case, content, folder_called

from stereo_occ.checkpoint import KEY, VERSION


def chain(*steps: Callable[[Path], Any]) -> Callable[[Path], None]:
    def prepare(folder: Path) -> None:
        for step in steps:
            step(folder)

    return prepare


def resaved(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    """The checkpoint with something changed, saved as torch does."""

    def prepare(folder: Path) -> None:
        checkpoint = torch.load(folder / "tiny.ckpt", weights_only=True)
        change(checkpoint)
        (folder / "tiny.ckpt").unlink()
        torch.save(checkpoint, folder / "tiny.ckpt")

    return prepare


def reconfigured(**changes: Any) -> Callable[[Path], None]:
    return resaved(lambda checkpoint: settings(checkpoint).update(changes))


def settings(checkpoint: dict[str, Any]) -> dict[str, Any]:
    return checkpoint[KEY]["config"]


def flipped(name: str, share: float) -> Callable[[Path], None]:
    """A file with one bit flipped at a share of its length."""

    def prepare(folder: Path) -> None:
        data = bytearray((folder / name).read_bytes())
        data[int(share * len(data))] ^= 4
        content(name, bytes(data))(folder)

    return prepare


def moved(name: str, place: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).rename(folder / place) and None


def first_name(checkpoint: dict[str, Any]) -> str:
    return next(name for name in checkpoint["state_dict"] if name.endswith("weight"))


def nan_weight(checkpoint: dict[str, Any]) -> None:
    checkpoint["state_dict"][first_name(checkpoint)][0] = torch.nan


def short_weight(checkpoint: dict[str, Any]) -> None:
    name = first_name(checkpoint)
    checkpoint["state_dict"][name] = checkpoint["state_dict"][name][:1]


class Payload:
    """Makes a folder when it is unpickled."""

    def __reduce__(self):
        return (Path.mkdir, (Path("it_ran"),))


#: As ``report`` takes them.
REPORTS = [
    Case("a page over somebody's notes", r"output=notes\.html: would write over notes\.md, which is of no report",
         ["output=notes.html"], content("notes.md", "mine")),
    Case("a folder for a page", r"output=page\.html: is a folder", ["output=page.html"], folder_called("page.html")),
]  # fmt: skip

#: As ``export`` takes them; ``tiny.ckpt`` is a good one.
CHECKPOINTS = [
    Case("no name for weights", r"output=: must be a path without a suffix", ["output="]),
    Case("a card over somebody's notes", r"output=README: would write over README\.md, which is of no weights",
         ["output=README"], content("README.md", "mine")),
    Case("a description over the metrics", r"output=m: would write over metrics=m\.json; give another file",
         ["output=m", "metrics=m.json"], content("m.json", "{}")),
    Case("a card that is a folder", r"output=w: would write w\.md, which is a folder", ["output=w"],
         folder_called("w.md")),
    Case("a missing checkpoint", r"checkpoint=none\.ckpt: no such file, nor the name of shipped weights",
         ["checkpoint=none.ckpt"]),
    Case("a folder for a checkpoint", r"checkpoint=tiny\.ckpt: no such file",
         prepare=folder_called("tiny.ckpt")),
    Case("text for a checkpoint", r"checkpoint=tiny\.ckpt: is damaged, or holds more than",
         prepare=content("tiny.ckpt", "text")),
    Case("an empty checkpoint", r"checkpoint=tiny\.ckpt: is damaged", prepare=content("tiny.ckpt", "")),
    Case("half a checkpoint", r"checkpoint=tiny\.ckpt: is damaged",
         prepare=lambda folder: content("tiny.ckpt", (folder / "tiny.ckpt").read_bytes()[:9000])(folder)),
    Case("a flipped bit in a checkpoint", r"checkpoint=tiny\.ckpt: is damaged, its content differs from its checksums",
         prepare=flipped("tiny.ckpt", 0.6)),
    Case("a checkpoint with code", r"checkpoint=tiny\.ckpt: is damaged, or holds more than tensors and plain values",
         prepare=resaved(lambda checkpoint: checkpoint.update(more=Payload()))),
    Case("torch's weights of something else", r"checkpoint=tiny\.ckpt: is no checkpoint of a training run",
         prepare=resaved(lambda checkpoint: checkpoint.pop(KEY))),
    Case("a checkpoint without weights", r"checkpoint=tiny\.ckpt: is no checkpoint of a training run",
         prepare=resaved(lambda checkpoint: checkpoint.pop("state_dict"))),
    Case("a checkpoint without a configuration", r"checkpoint=tiny\.ckpt: configuration: .*another version",
         prepare=resaved(lambda checkpoint: checkpoint[KEY].pop("config"))),
    Case("a checkpoint of tomorrow", rf"checkpoint=tiny\.ckpt: has format version {VERSION + 1}, expected {VERSION}",
         prepare=resaved(lambda checkpoint: checkpoint[KEY].update(version=VERSION + 1))),
    Case("weights of another shape", r"checkpoint=tiny\.ckpt: its weights do not fit its configuration",
         prepare=resaved(short_weight)),
    Case("a weight that is NaN", r"checkpoint=tiny\.ckpt: holds NaN or infinite numbers.*diverged",
         prepare=resaved(nan_weight)),
    Case("a threshold of NaN", r"checkpoint=tiny\.ckpt: holds NaN",
         prepare=resaved(lambda checkpoint: checkpoint["state_dict"].update(threshold=torch.tensor(torch.nan)))),
    Case("no threshold", r"checkpoint=tiny\.ckpt: its weights do not fit",
         prepare=resaved(lambda checkpoint: checkpoint["state_dict"].pop("threshold"))),
    Case("an unknown key in its configuration", r"checkpoint=tiny\.ckpt: configuration: .*another version",
         prepare=reconfigured(colour=3)),
    Case("a list for its configuration", r"checkpoint=tiny\.ckpt: configuration: .*another version",
         prepare=resaved(lambda checkpoint: checkpoint[KEY].update(config=[1]))),
    Case("a word for its steps", r"checkpoint=tiny\.ckpt: configuration: .*another version",
         prepare=reconfigured(steps="many")),
    Case("an unknown model in its configuration", r"model: unknown 'none'",
         prepare=reconfigured(model={"name": "none"})),
    Case("code named in its configuration", r"model: unknown 'os\.mkdir'",
         prepare=reconfigured(model={"name": "os.mkdir", "_target_": "os.mkdir", "path": "it_ran"})),
    Case("code named beside its settings", r"has no setting _target_",
         prepare=resaved(lambda checkpoint: settings(checkpoint)["model"].update(_target_="os.mkdir", path="it_ran"))),
    Case("the environment named in its configuration", r"checkpoint=tiny\.ckpt: configuration: holds \$\{\.\.\.\}",
         prepare=reconfigured(paths={"outputs": "${oc.env:HOME}", "data": "data"})),
    Case("weights without their description", r"none cannot be read|w\.json cannot be read .*two files",
         ["checkpoint=w"], content("w.safetensors", "x")),
    Case("broken weights", r"checkpoint=w\.safetensors: is damaged; copy it again", ["checkpoint=w.safetensors"],
         chain(content("w.safetensors", "x" * 99), content("w.json", '{"version": 1, "config": {}}'))),
    Case("a broken description", r"checkpoint=w\.safetensors: w\.json is damaged", ["checkpoint=w.safetensors"],
         chain(content("w.safetensors", "x"), content("w.json", "{"))),
    Case("a description of nothing", r"checkpoint=w\.safetensors: .*w\.json describes no weights|is damaged",
         ["checkpoint=w.safetensors"],
         chain(content("w.safetensors", (2).to_bytes(8, "little") + b"{}"), content("w.json", "[]"))),
    Case("an output with a suffix", r"output=x\.json: must be a path without a suffix", ["output=x.json"]),
    Case("an output that cannot be", r"output=.*cannot be written \((Not a directory|File exists)\)",
         ["output=tiny.ckpt/x"]),
    Case("metrics that are none", r"metrics=bad\.json: cannot be read; give the metrics\.json",
         ["metrics=bad.json"], content("bad.json", "[1")),
    *[Case(f"{text} for metrics", r"metrics=bad\.json: cannot be read; give the metrics\.json",
           ["metrics=bad.json"], content("bad.json", text))
      for text in ("[1]", "3", '{"metrics": null}', '{"metrics": [1]}', '{"best": "x"}')],
]  # fmt: skip


def in_shard(change: Callable[[h5py.File], Any]) -> Callable[[Path], None]:
    """The mug's shard with something changed."""

    def prepare(folder: Path) -> None:
        with h5py.File(shard(folder), "r+", libver="latest") as file:
            change(file)

    return prepare


def shard(folder: Path) -> Path:
    return next((folder / "data").rglob("mug/*.h5"))


def replaced(name: str, data: Any) -> Callable[[Path], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = data

    return in_shard(change)


def linked(name: str, link: Any) -> Callable[[Path], None]:
    return replaced(name, link)


def elsewhere(file: h5py.File) -> None:
    """Colours that are the bytes of another file, named by its absolute path."""
    secret = Path(file.filename).parents[3] / "secret"
    secret.write_bytes(bytes(100_000))
    del file["views/rgb"]
    file.create_dataset("views/rgb", (1, 2, 32, 32, 3), "u1", external=[(str(secret), 0, 2 * 32 * 32 * 3)])


def virtual(file: h5py.File) -> None:
    shape = file["views/rgb"].shape
    layout = h5py.VirtualLayout(shape, "u1")
    layout[:] = h5py.VirtualSource("/secret.h5", "x", shape)
    del file["views/rgb"]
    file.create_virtual_dataset("views/rgb", layout)


def overwritten(data: bytes) -> Callable[[Path], None]:
    return lambda folder: shard(folder).write_bytes(data)


def cut(folder: Path) -> None:
    shard(folder).write_bytes(shard(folder).read_bytes()[:-9])


def instead_a_folder(folder: Path) -> None:
    place = shard(folder)
    place.unlink()
    place.mkdir()


def flipped_pixel(folder: Path) -> None:
    with h5py.File(shard(folder), "r") as file:
        offset = file["views/rgb"].id.get_chunk_info(0).byte_offset
    data = bytearray(shard(folder).read_bytes())
    data[offset + 20] ^= 1
    shard(folder).write_bytes(data)


def shard_case(name: str, message: str, prepare: Callable[[Path], Any]) -> Case:
    return Case(name, r"\.h5: " + message + ".*delete it and render again", [], prepare)


CANNOT = r"cannot read the shard \("

#: As ``evaluate`` takes them, of a data set that is rendered.
SHARDS = [
    shard_case("an empty shard", CANNOT, overwritten(b"")),
    shard_case("text for a shard", CANNOT, overwritten(b"text")),
    shard_case("a shortened shard", CANNOT, cut),
    shard_case("a folder for a shard", CANNOT, instead_a_folder),
    shard_case("a flipped bit in a picture", CANNOT, flipped_pixel),
    shard_case("a shard of tomorrow", "is stereo_occ.shard version 2, expected stereo_occ.shard version 1",
               in_shard(lambda file: file.attrs.update(version=2))),
    shard_case("another HDF5 file", "is None version None, expected stereo_occ.shard",
               in_shard(lambda file: [file.attrs.pop(name) for name in list(file.attrs)])),
    shard_case("no pictures", CANNOT + "views/rgb is missing", in_shard(lambda file: file.pop("views/rgb"))),
    shard_case("a picture of floats", CANNOT + "views/rgb is no array of type u1",
               replaced("views/rgb", np.zeros((2, 2, 32, 32, 3)))),
    shard_case("cameras of another shape", CANNOT + "views/K is no array",
               replaced("views/K", np.zeros((2, 3, 3)))),
    shard_case("a group for an array", CANNOT + "views/K is no array",
               in_shard(lambda file: (file.pop("views/K"), file.create_group("views/K")))),
    shard_case("fewer views than asked for", CANNOT, replaced("views/rgb", np.zeros((0, 2, 32, 32, 3), np.uint8))),
    shard_case("a link to another file", CANNOT + "views/rgb is missing, or a link to elsewhere",
               linked("views/rgb", h5py.ExternalLink("/secret.h5", "/x"))),
    shard_case("a group in another file", CANNOT + "views/.* is missing, or a link to elsewhere",
               linked("views", h5py.ExternalLink("/secret.h5", "/x"))),
    shard_case("a soft link", CANNOT + "views/rgb is missing, or a link to elsewhere",
               linked("views/rgb", h5py.SoftLink("/views/mask"))),
    shard_case("an array in another file", CANNOT + "views/rgb is no array .*in the file itself",
               in_shard(elsewhere)),
    shard_case("an array of other files' parts", CANNOT + "views/rgb is no array .*in the file itself",
               in_shard(virtual)),
    shard_case("a name that leads out", CANNOT + r"object_id '\.\./\.\./it_ran' is no plain name",
               in_shard(lambda file: file.attrs.update(object_id=np.bytes_(b"../../it_ran")))),
    shard_case("an absolute name", CANNOT + "category '/tmp/it_ran' is no plain name",
               in_shard(lambda file: file.attrs.update(category=np.bytes_(b"/tmp/it_ran")))),
]  # fmt: skip


def mesh_folder(*files: tuple[str, str]) -> Callable[[Path], None]:
    def prepare(folder: Path) -> None:
        (folder / "meshes").mkdir(exist_ok=True)
        for name, text in files:
            path = folder / "meshes" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    return prepare


TABLE = ["data.table=meshes/t.csv"]
BROKEN = mesh_folder(("mug/a.obj", "v 0 0 0\n"))

#: As ``render data=meshes data.root=meshes`` takes them.
FOLDERS = [
    Case("a missing folder of meshes", r"data\.root=none: no such folder; give", ["data.root=none"]),
    Case("a file for the folder", r"data\.root=meshes: no such folder; give", prepare=content("meshes", "x")),
    Case("an empty folder", r"data\.root=meshes: holds no category \(no folders\); lay it out as",
         prepare=mesh_folder()),
    Case("unknown categories", r"data\.root=meshes: holds no category \(cups\); lay it out as",
         prepare=mesh_folder(("cups/a.obj", ""))),
    Case("no table", r"data\.table=meshes/t\.csv: cannot be read .*give a CSV file", TABLE, BROKEN),
    Case("a table without columns", r"has no column file and no category but x; its columns are",
         TABLE, mesh_folder(("t.csv", "x\n1\n"))),
    Case("a table that leads out", r"t\.csv, row 2: file='\.\./x\.obj' must be a path below data\.root", TABLE,
         mesh_folder(("t.csv", "file,category\n../x.obj,mug\n"))),
    Case("a table with an absolute path", r"t\.csv, row 2: file='/etc/x\.obj' must be a path below data\.root",
         TABLE,
         mesh_folder(("t.csv", "file,category\n/etc/x.obj,mug\n"))),
    Case("a table with a name that leads out", r"t\.csv, row 2: name '\.\./x' cannot be part of a file name",
         TABLE,
         mesh_folder(("t.csv", "file,category,name\na.obj,mug,../x\n"))),
    Case("a table with an unknown subset", r"t\.csv, row 2: subset='dev' must be one of train", TABLE,
         mesh_folder(("t.csv", "file,category,subset\na.obj,mug,dev\n"))),
    Case("a table with an open quote", r"t\.csv: cannot be read \(unexpected end of data\)", TABLE,
         mesh_folder(("t.csv", 'file,category\n"a.obj,mug\nb.obj,mug\n'))),
    Case("a table with a line break in a name", r"row 3: file='\.\./a\\nb\.obj' must be a path below data\.root", TABLE,
         mesh_folder(("t.csv", 'file,category\n"../a\nb.obj",mug\n'))),
    Case("no time for a mesh", r"data\.time_limit=0\.0: must be above 0 seconds",
         ["data.time_limit=0"], BROKEN),
    Case("no memory for a mesh", r"data\.memory_limit=0\.1: must be at least 1 GB",
         ["data.memory_limit=0.1"], BROKEN),
    Case("ShapeNet elsewhere", r"data\.root=meshes: holds none of 02876657 \(bottle\)",
         ["data=shapenet"], BROKEN),
    Case("a list of ShapeNet's that is binary", r"train\.lst: cannot be read", ["data=shapenet"],
         chain(mesh_folder(("03797390/a/model.obj", "")), content("meshes/03797390/train.lst", b"\xff\xfe\xff"))),
    Case("data that cannot be written", r"cannot be written .*(set paths\.data|another folder)",
         ["data=procedural", "paths.data=meshes"], content("meshes", "x")),
    Case("outputs that cannot be written", r"(Not a directory|File exists); choose another folder",
         ["data=procedural", "paths.outputs=meshes"], content("meshes", "x")),
]  # fmt: skip

#: As ``inspect data.root=meshes`` takes them.
INSPECTIONS = [
    Case("a category without meshes", r"data\.root=meshes: holds no mesh of mug, bowl, bottle; lay it out as",
         prepare=lambda folder: (folder / "meshes" / "mug").mkdir(parents=True)),
]  # fmt: skip

#: As ``render`` takes them.
SETTINGS = [
    Case("a word for a number", r"data\.views=many: must be a whole number", ["data.views=many"]),
    Case("a misspelt key", r"data\.veiws: unknown key; did you mean data\.views", ["data.veiws=3"]),
    Case("an unknown choice", r"rig=papper: unknown choice; did you mean paper", ["rig=papper"]),
    Case("several values without -m", r"data\.views=1,2: gives several values; add -m", ["data.views=1,2"]),
    Case("what is no override", r"verify: cannot be read; write key=value", ["verify"]),
    Case("no views", r"data\.views=0: must be at least 1", ["data.views=0"]),
    Case("vast images", r"data\.image_side=100000: must be at most 4096", ["data.image_side=100000"]),
    Case("negative workers", r"workers=-1: must be at least 0", ["workers=-1"]),
    Case("an infinite distance", r"rig\.distance=inf: must be 0\.1 to 100", ["rig.distance=inf"]),
    Case("NaN for an angle", r"rig\.half_angle_deg=nan: must be 0\.01 to 89",
         ["rig.half_angle_deg=nan"]),
    Case("NaN for a size", r"placement\.diagonal=\[nan, 1\.0\]: must be \[low, high\]",
         ["placement.diagonal=[nan,1]"]),
    Case("NaN for a share", r"data\.fractions=\[nan, 0\.1, 0\.1\]: must be three shares",
         ["data.fractions=[nan,0.1,0.1]"]),
    Case("an unknown category", r"categories\.names=mgu: unknown; did you mean mug",
         ["categories.names=[mgu]"]),
    Case("an unknown subset", r"subset=tset: unknown; did you mean test", ["subset=tset"]),
    Case("a slice beyond the last", r"slice\.index=5: must be 1 to slice\.of=4",
         ["slice.of=4", "slice.index=5"]),
    Case("NaN for a light", r"lights\.\w+: must be", ["lights.ambient=[nan,1]"]),
]  # fmt: skip

#: As ``train`` takes them.
TRAININGS = [
    Case("a learning rate of NaN", r"optimizer\.lr=nan: must be above 0 and finite", ["optimizer.lr=nan"]),
    Case("an infinite learning rate", r"optimizer\.lr=inf: must be above 0 and finite", ["optimizer.lr=inf"]),
    Case("an infinite decay", r"optimizer\.weight_decay=inf: must be at least 0 and finite",
         ["optimizer.weight_decay=inf"]),
    Case("more points than there are", r"points=9999: there are only data\.pool_size=2000", ["points=9999"]),
    Case("a file for the run folder", r"run: (Not a directory|File exists); choose another folder",
         ["hydra.run.dir=run"], content("run", "x")),
    Case("a run of other settings", r"run: holds a run with another seed; choose another hydra\.run\.dir, or resume=",
         ["hydra.run.dir=run", "seed=5"], chain(folder_called("run"), moved("tiny.ckpt", "run/last.ckpt"))),
    Case("a damaged latest checkpoint", r"last\.ckpt: is damaged.*copy best\.ckpt over it, or say resume=never",
         ["hydra.run.dir=run"], chain(folder_called("run"), content("run/last.ckpt", "x"))),
]  # fmt: skip

#: As ``compare`` takes them: two folders.
COMPARISONS = [
    Case("a missing result", r"none: no such folder; give the folder of an evaluation", ["none", "none"]),
    Case("a folder without a result", r"a.*metrics\.json", ["a", "a"], folder_called("a")),
    Case(
        "a broken result",
        r"a.*metrics\.json",
        ["a", "a"],
        chain(folder_called("a"), content("a/metrics.json", "{")),
    ),
]
