"""Render the shards that a configuration asks for and that are not there yet."""

import hashlib
import json
import multiprocessing
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from enum import Enum
from functools import cache
from pathlib import Path

import numpy as np
from tqdm import tqdm

from stereo_occ.config import PairsConfig
from stereo_occ.cores import available_cores
from stereo_occ.data.config import NOT_CONTENT, SliceConfig
from stereo_occ.data.meshes import MeshRecord
from stereo_occ.data.objects import Objects, ObjectSource, list_objects, members
from stereo_occ.data.pairs import Stream, render_views
from stereo_occ.data.processes import start_worker
from stereo_occ.data.rigs import ToedInRigConfig
from stereo_occ.data.seeds import object_seed
from stereo_occ.data.shard import VERSION
from stereo_occ.data.shard_writing import write_shard
from stereo_occ.errors import UserError
from stereo_occ.occupancy.pools import box_pool, surface_pool
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.shapes.layouts import Skipped
from stereo_occ.writing import remove_partial, whole_file


@dataclass(frozen=True)
class PreparedShards:
    """Shards on disk: ``paths[i]`` holds ``sources[i]``.

    ``skipped`` are files that are no usable object, ``records`` what became of all mesh files of the data set.
    """

    folder: Path
    sources: list[ObjectSource]
    paths: list[Path]
    skipped: list[Skipped]
    records: list[MeshRecord]


def prepare(
    pairs: PairsConfig,
    progress: bool,
    subset: str = "all",
    part: SliceConfig | None = None,
    objects: Objects | None = None,
) -> PreparedShards:
    """Make sure that every shard of ``pairs`` exists; render the missing ones with a progress bar.

    A shard's content depends on the configuration and the object alone: not on the number of processes, nor on which
    other objects are asked for, nor on interruptions. Any number of processes and machines may do this at once in the
    same folder.

    Args:
        subset: ``train``, ``val`` or ``test`` for the shards of that subset alone.
        part: a slice of these shards, for several machines to share the work.
        objects: of ``pairs``, where they are listed already.

    Raises:
        UserError: from the objects, the renderer or the disk.
    """
    prepared = locate(pairs, progress, subset, part, objects)
    found = zip(prepared.sources, prepared.paths, strict=True)
    missing = [(source, path) for source, path in found if not path.exists()]
    if missing:
        folder = prepared.folder
        remove_partial((*folder.glob(".*.part"), *folder.glob("*/.*.part")))
        _write_description(prepared.folder, pairs)
        workers = min(len(missing), pairs.workers or available_cores())
        bar = tqdm(
            total=len(missing) * pairs.data.views,
            desc="rendering",
            unit="pair",
            disable=not progress,
            smoothing=0.05,
        )
        with bar:
            for _ in _render_all(missing, pairs, workers):
                bar.update(pairs.data.views)
    return prepared


def locate(
    pairs: PairsConfig,
    progress: bool,
    subset: str = "all",
    part: SliceConfig | None = None,
    objects: Objects | None = None,
) -> PreparedShards:
    """Where the shards of ``pairs`` are, or will be when they are rendered; see :func:`prepare`."""
    objects = objects or list_objects(pairs, progress)
    sources = members(objects.sources, pairs, subset)
    if part is not None:
        sources = sources[part.index - 1 :: part.of]
    folder = Path(pairs.paths.data) / _folder_name(pairs)
    paths = [folder / source.category / source.file_name for source in sources]
    return PreparedShards(folder, sources, paths, objects.skipped, objects.records)


def render_object(source: ObjectSource, path: Path, pairs: PairsConfig) -> None:
    """Build, render, label and write one object."""
    data = pairs.data
    shape = source.build()
    seed = [data.seed, object_seed(source.category, source.object_id)]
    points_rng = np.random.default_rng([*seed, Stream.POINTS])
    pools = {
        "box": box_pool(shape, data.pool_size, points_rng),
        "surface": surface_pool(shape, data.pool_size, points_rng),
    }
    views = render_views(shape, pairs, seed, _renderer())
    write_shard(path, shape, views, pools)


@cache
def _renderer() -> StereoRenderer:
    """The one renderer of this process."""
    return StereoRenderer()


def _render_all(tasks: list[tuple[ObjectSource, Path]], pairs: PairsConfig, workers: int) -> Iterable[None]:
    if workers == 1:
        for source, path in tasks:
            render_object(source, path, pairs)
            yield
        return
    # Spawned, not forked: a forked process inherits a GL state that hangs it.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=start_worker) as pool:
        jobs = [pool.submit(render_object, source, path, pairs) for source, path in tasks]
        try:
            for job in as_completed(jobs):
                yield job.result()
        except BrokenProcessPool as error:
            raise UserError(
                f"workers={workers}: a rendering process was killed, perhaps for want of memory; ask for fewer; "
                f"what is finished is kept"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _folder_name(pairs: PairsConfig) -> str:
    """A name that changes with everything that changes a shard's content."""
    digest = hashlib.sha256(json.dumps(_description(pairs), sort_keys=True).encode()).hexdigest()
    return f"{pairs.data.name}_{pairs.data.image_side}px_{digest[:10]}"


def _description(pairs: PairsConfig) -> dict[str, object]:
    data = asdict(pairs.data)
    for key in NOT_CONTENT:
        data.pop(key, None)
    if "root" in data:
        data["root"] = str(Path(data["root"]).resolve())
    parts = {
        name: asdict(getattr(pairs, name))
        for name in ("rig", "placement", "lights", "material", "background")
    }
    if parts["rig"]["kind"] == ToedInRigConfig.kind:
        del parts["rig"]["kind"]
    if not parts["background"]["masked"]:
        del parts["background"]["masked"]
    parts |= {
        name: asdict(group) for name in ("texture", "sensor") if not (group := getattr(pairs, name)).off
    }
    return _plain({"shard_version": VERSION, "data": data, **parts})  # type: ignore[return-value]


def _plain(value: object) -> object:
    """Without what is off, so that a data set keeps its name when there is more that could be on."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    return value.value if isinstance(value, Enum) else value


def _write_description(folder: Path, pairs: PairsConfig) -> None:
    text = json.dumps(_description(pairs), indent=2, sort_keys=True) + "\n"
    try:
        with whole_file(folder / "dataset.json") as file:
            file.write(text.encode())
    except OSError as error:
        raise UserError(
            f"paths.data={pairs.paths.data}: cannot be written ({error}); give another folder"
        ) from error
