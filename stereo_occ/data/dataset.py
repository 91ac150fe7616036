"""Map-style data sets over shards; items are asked for and returned as whole batches."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset, Sampler

from stereo_occ.config import QueriesConfig
from stereo_occ.data.augmentation import AugmentationConfig, augmented
from stereo_occ.data.batch import Batch, ImageTruth, Queries, ViewId
from stereo_occ.data.controls import ControlConfig, controlled, right_item
from stereo_occ.data.seeds import object_seed
from stereo_occ.data.shard import Shard
from stereo_occ.errors import UserError
from stereo_occ.models.base import StereoViews
from stereo_occ.occupancy.queries import (
    LabelledPoints,
    cube_queries,
    outside_queries,
    pool_queries,
)

#: Of the random numbers of a batch, after its seed and position; those of its points have none.
AUGMENTATION_STREAM = 1


@dataclass(frozen=True)
class Draw:
    """One item of a training batch: which view, and its position in the run, which seeds its points."""

    item: int
    position: int


class ShuffledBatches(Sampler[list[Draw]]):
    """Batches of one long shuffled stream, a pure function of (seed, step).

    The stream is one permutation of all items after another, cut into batches without regard to where a permutation
    ends, so every batch is full and a run continues from any step with the data it would have seen.

    Args:
        place: which of how many processes this is; each gets an equal part of every batch.

    Raises:
        UserError: a batch cannot be divided equally.
    """

    def __init__(
        self,
        items: int,
        batch_size: int,
        steps: int,
        seed: int,
        first_step: int = 0,
        place: tuple[int, int] = (0, 1),
    ) -> None:
        self.rank, processes = place
        if batch_size % processes:
            raise UserError(
                f"batch_size={batch_size}: must be a multiple of the {processes} processes that share it"
            )
        self.part = batch_size // processes
        self.items = items
        self.batch_size = batch_size
        self.steps = steps
        self.seed = seed
        self.first_step = first_step

    def __len__(self) -> int:
        return self.steps

    def __iter__(self) -> Iterator[list[Draw]]:
        first, last = self.first_step * self.batch_size, self.steps * self.batch_size
        batch: list[Draw] = []
        for epoch in range(first // self.items, -(-last // self.items)):
            order = np.random.default_rng([self.seed, epoch]).permutation(self.items)
            start = epoch * self.items
            for position in range(max(first, start), min(last, start + self.items)):
                batch.append(Draw(int(order[position - start]), position))
                if len(batch) == self.batch_size:
                    yield batch[self.rank * self.part : (self.rank + 1) * self.part]
                    batch = []


class DealtBatches(Sampler[list[int]]):
    """Batches of all items in order, the same whoever gets them, dealt out in turn to the processes.

    Nothing is cut or filled up. A process that would get nothing gets the first batch, like the first process.

    Args:
        place: which of how many processes this is.
    """

    def __init__(self, items: int, batch_size: int, place: tuple[int, int] = (0, 1)) -> None:
        rank, processes = place
        starts = range(0, items, batch_size)
        batches = [list(range(start, min(start + batch_size, items))) for start in starts]
        self.batches = batches[rank::processes] or batches[:1]

    def __len__(self) -> int:
        return len(self.batches)

    def __iter__(self) -> Iterator[list[int]]:
        return iter(self.batches)


class PairsDataset(Dataset[Batch]):
    """Stereo pairs of some views of some shards, without points: the part that training and evaluation share.

    Raises:
        UserError: there is no other object to take right images from, as ``control`` says.
    """

    def __init__(
        self, shards: Sequence[Shard], views: Sequence[int], control: ControlConfig | None = None
    ) -> None:
        self.shards = shards
        self.views = views
        self.control = control or ControlConfig()
        if self.control.name == "right_shuffled" and len(shards) < 2:
            raise UserError(
                "control=right_shuffled: takes right images from other objects, and there is only one; use right_zeroed"
            )

    def __len__(self) -> int:
        return len(self.shards) * len(self.views)

    def locate(self, item: int) -> tuple[Shard, int]:
        """The shard and the view of an item; all views of one object follow each other."""
        shard, view = divmod(item, len(self.views))
        return self.shards[shard], self.views[view]

    def batch(self, items: Sequence[int], points: Sequence[dict[str, LabelledPoints]]) -> Batch:
        """Images, cameras and names of ``items`` with their labelled points."""
        located = [self.locate(item) for item in items]
        rgb_B2HWC = torch.from_numpy(self._pairs_of(Shard.rgb, items))
        rgb_2BCHW = rgb_B2HWC.permute(1, 0, 4, 2, 3).float().div_(255)
        K_B, camera_from_rig_B = zip(*(shard.cameras(view) for shard, view in located), strict=True)
        return Batch(
            views=StereoViews(
                rgb_2BCHW[0], rgb_2BCHW[1], _float(np.stack(K_B)), _float(np.stack(camera_from_rig_B))
            ),
            queries={
                name: Queries(
                    _float(np.stack([item[name].points_N3 for item in points])),
                    _float(np.stack([item[name].occupied_N for item in points])),
                )
                for name in points[0]
            },
            ids=[ViewId(shard.category, shard.object_id, view) for shard, view in located],
        )

    def image_truth(self, items: Sequence[int]) -> ImageTruth:
        """Masks and depths of ``items``."""
        return ImageTruth(
            _float(self._pairs_of(Shard.mask, items)).div_(255),
            _float(self._pairs_of(Shard.depth, items)),
            _float(self._pairs_of(_origin_depths, items)),
        )

    def _pairs_of(
        self, read: Callable[[Shard, int], NDArray[np.generic]], items: Sequence[int]
    ) -> NDArray[np.generic]:
        """What ``read`` gives for the two images of each of ``items``, ``(B, 2, ...)``."""
        pairs = np.stack([read(*self.locate(item)) for item in items])
        for place, item in enumerate(items):
            other = right_item(self.control, item, len(self.shards), len(self.views))
            if other != item:
                pairs[place, 1] = read(*self.locate(other))[1]
        return pairs


class TrainingPairs(PairsDataset):
    """Pairs with randomly drawn query points under the name ``train``, augmented.

    Args:
        truth: whether batches have their images' masks and depths.
    """

    def __init__(
        self,
        shards: Sequence[Shard],
        views: Sequence[int],
        queries: QueriesConfig,
        points: int,
        seed: int,
        control: ControlConfig | None = None,
        augmentation: AugmentationConfig | None = None,
        truth: bool = False,
    ) -> None:
        super().__init__(shards, views, control)
        ends = np.rint(np.cumsum([queries.box, queries.outside, queries.surface]) * points).astype(int)
        self.counts = dict(zip(("box", "outside", "surface"), np.diff(ends, prepend=0).tolist(), strict=True))
        self.seed = seed
        self.augmentation = augmentation or AugmentationConfig()
        self.truth = truth

    def __getitems__(self, draws: list[Draw]) -> Batch:
        items = [draw.item for draw in draws]
        batch = self.batch(items, [{"train": self._points(draw)} for draw in draws])
        if self.truth:
            batch = replace(batch, truth=self.image_truth(items))
        rng = np.random.default_rng([self.seed, draws[0].position, AUGMENTATION_STREAM])
        return controlled(self.control, augmented(self.augmentation, batch, rng))

    def _points(self, draw: Draw) -> LabelledPoints:
        shard, view = self.locate(draw.item)
        pose, box = shard.pose(view), shard.pool("box")
        rng = np.random.default_rng([self.seed, draw.position])
        parts = []
        if self.counts["box"]:
            parts.append(pool_queries(box, pose, self.counts["box"], rng))
        if self.counts["outside"]:
            parts.append(outside_queries(box, pose, self.counts["outside"], rng))
        if self.counts["surface"]:
            parts.append(pool_queries(shard.pool("surface"), pose, self.counts["surface"], rng))
        return LabelledPoints(
            np.concatenate([part.points_N3 for part in parts]),
            np.concatenate([part.occupied_N for part in parts]),
        )


class EvaluationPairs(PairsDataset):
    """Pairs with fixed query points, the same for every model and in every run.

    ``bbox`` is uniform in the posed bounding box, ``cube`` uniform in the working volume, and ``unposed`` are the
    points of ``bbox`` left in the object frame, with the labels they have there: the suspected metric of the paper.
    """

    def __init__(
        self,
        shards: Sequence[Shard],
        views: Sequence[int],
        points: int,
        control: ControlConfig | None = None,
    ) -> None:
        super().__init__(shards, views, control)
        self.points = points

    def __getitems__(self, items: list[int]) -> Batch:
        return controlled(self.control, self.batch(items, [self._points(item) for item in items]))

    def _points(self, item: int) -> dict[str, LabelledPoints]:
        shard, view = self.locate(item)
        pose, pool = shard.pose(view), shard.pool("box")
        rng = np.random.default_rng([object_seed(shard.category, shard.object_id), view])
        bbox = pool_queries(pool, pose, self.points, rng)
        cube = cube_queries(pool, pose, self.points, rng)
        return {
            "bbox": bbox,
            "cube": cube,
            "unposed": LabelledPoints(pose.to_object(bbox.points_N3), bbox.occupied_N),
        }


def whole_batch(batch: Any) -> Any:
    """Collate nothing. It is here and not beside the loaders so that loading processes need not import lightning."""
    return batch


def _origin_depths(shard: Shard, view: int) -> NDArray[np.float64]:
    """Of the rig's origin in both images ``(2,)``."""
    return shard.cameras(view)[1][:, 2, 3]


def _float(array: NDArray[np.generic]) -> torch.Tensor:
    return torch.from_numpy(array.astype(np.float32))
