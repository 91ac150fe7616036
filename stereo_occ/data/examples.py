"""The pairs that pictures show, chosen by rule."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from trimesh import Trimesh

from stereo_occ.data.batch import Batch, ViewId
from stereo_occ.data.dataset import EvaluationPairs


@dataclass(frozen=True, eq=False)
class Example:
    """One pair as a batch of one, and the true mesh in the rig frame."""

    id: ViewId
    batch: Batch
    true: Trimesh


def examples(dataset: EvaluationPairs, count: int) -> Iterator[Example]:
    """The first view of the first ``count`` objects of each category."""
    shown: Counter[str] = Counter()
    for index, shard in enumerate(dataset.shards):
        if shown[shard.category] < count:
            shown[shard.category] += 1
            batch = dataset.__getitems__([index * len(dataset.views)])
            pose = shard.pose(dataset.views[0])
            yield Example(batch.ids[0], batch, shard.mesh.apply_transform(pose.rig_from_object))
