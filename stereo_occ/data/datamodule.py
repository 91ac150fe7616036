"""Lightning's view of the shards."""

from typing import Any

import lightning
from torch.utils.data import DataLoader

from stereo_occ.config import PairsConfig, QueriesConfig
from stereo_occ.data.augmentation import AugmentationConfig
from stereo_occ.data.batch import Batch
from stereo_occ.data.config import SplitKind
from stereo_occ.data.controls import ControlConfig
from stereo_occ.data.dataset import DealtBatches, EvaluationPairs, ShuffledBatches, TrainingPairs, whole_batch
from stereo_occ.data.objects import Objects, members
from stereo_occ.data.prepare import PreparedShards, prepare
from stereo_occ.data.shard import Shard
from stereo_occ.data.splits import SUBSETS, split_views
from stereo_occ.errors import UserError
from stereo_occ.group import place


class PairsDataModule(lightning.LightningDataModule):
    """Renders what is missing, divides it into subsets and serves batches.

    Args:
        evaluation_views: poses per object in validation and test.
        evaluation_points: query points per pose and metric.
        only: the one subset that will be asked for, so that no other is rendered.
        control: that all batches are under.
        objects: of ``pairs``, where they are listed already.
    """

    def __init__(
        self,
        pairs: PairsConfig,
        evaluation_views: int,
        evaluation_points: int,
        evaluation_batch_size: int,
        workers: int = 0,
        progress: bool = True,
        only: str = "all",
        control: ControlConfig | None = None,
        objects: Objects | None = None,
    ) -> None:
        super().__init__()
        self.pairs = pairs
        self.evaluation_views = evaluation_views
        self.evaluation_points = evaluation_points
        self.evaluation_batch_size = evaluation_batch_size
        self.workers = workers
        self.progress = progress
        self.only = only
        self.control = control or ControlConfig()
        self.objects = objects
        self.prepared: PreparedShards | None = None
        self._training: dict[str, Any] = {}

    def for_training(
        self,
        queries: QueriesConfig,
        points: int,
        batch_size: int,
        steps: int,
        seed: int,
        augmentation: AugmentationConfig | None = None,
        truth: bool = False,
    ) -> None:
        """Say what training needs; without it only the evaluation loaders work.

        Args:
            truth: whether batches have their images' masks and depths.
        """
        self._training = {
            "queries": queries,
            "points": points,
            "batch_size": batch_size,
            "steps": steps,
            "seed": seed,
            "augmentation": augmentation,
            "truth": truth,
        }

    def prepare_data(self) -> None:
        """Render the missing shards."""
        self.prepared = prepare(self.pairs, self.progress, self.only, objects=self.objects)

    def subset(self, name: str) -> tuple[list[Shard], list[int]]:
        """The shards of ``train``, ``val``, ``test`` or ``all``, and which views of each belong to it."""
        if name not in (*SUBSETS, "all"):
            raise UserError(f"subset={name}: must be one of {', '.join([*SUBSETS, 'all'])}")
        if self.only not in ("all", name):
            raise RuntimeError(f"made for subset {self.only} alone, asked for {name}")
        if self.prepared is None:
            self.prepare_data()
        assert self.prepared is not None
        data, sources = self.pairs.data, self.prepared.sources
        paths = dict(zip((source.key for source in sources), self.prepared.paths, strict=True))
        views = range(data.views)
        if data.split is SplitKind.view and name != "all":
            views = split_views(data.views, data.fractions, name)
        chosen = sources if name == self.only else members(sources, self.pairs, name)
        return [Shard(paths[source.key]) for source in chosen], list(views)

    def train_dataloader(self) -> DataLoader[Batch]:
        """Shuffled batches from the trainer's current step on."""
        settings = self._training
        shards, views = self.subset("train")
        dataset = TrainingPairs(
            shards,
            views,
            settings["queries"],
            settings["points"],
            settings["seed"],
            self.control,
            settings["augmentation"],
            settings["truth"],
        )
        first_step = self.trainer.global_step if self.trainer else 0
        batches = ShuffledBatches(
            len(dataset), settings["batch_size"], settings["steps"], settings["seed"], first_step, place()
        )
        return self._loader(dataset, batch_sampler=batches)

    def val_dataloader(self) -> DataLoader[Batch]:
        """Validation objects with fixed points."""
        return self.evaluation_loader("val")

    def evaluation_loader(self, subset: str) -> DataLoader[Batch]:
        """Fixed points on any subset."""
        dataset = self.evaluation_dataset(subset)
        return self._loader(
            dataset, batch_sampler=DealtBatches(len(dataset), self.evaluation_batch_size, place())
        )

    def evaluation_dataset(self, subset: str) -> EvaluationPairs:
        """The first ``evaluation_views`` poses of each object of a subset, with fixed points."""
        shards, views = self.subset(subset)
        if len(views) < self.evaluation_views:
            raise UserError(
                f"views={self.evaluation_views}: there are only {len(views)} of each object in {subset}; ask for fewer"
            )
        return EvaluationPairs(shards, views[: self.evaluation_views], self.evaluation_points, self.control)

    def _loader(self, dataset: TrainingPairs | EvaluationPairs, **kwargs: Any) -> DataLoader[Batch]:
        return DataLoader(
            dataset,
            collate_fn=whole_batch,
            num_workers=self.workers,
            persistent_workers=self.workers > 0,
            multiprocessing_context="spawn" if self.workers else None,
            **kwargs,
        )
