"""Schemas of the configuration: every key, its type and its meaning. The values are in ``conf/``.

Each YAML file lists its schema (``base_...``) first, so that unknown keys and wrong types fail with the full key.
"""

from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, OmegaConf

from stereo_occ.auxiliary import AuxiliaryConfig
from stereo_occ.averaging import AveragingConfig
from stereo_occ.baselines.config import BASELINE_SCHEMAS
from stereo_occ.data.augmentation import AugmentationConfig
from stereo_occ.data.config import DATA_SCHEMAS, DataConfig, SliceConfig
from stereo_occ.data.controls import ControlConfig
from stereo_occ.data.placement import PlacementConfig
from stereo_occ.data.rigs import RIG_SCHEMAS, RigConfig, ToedInRigConfig
from stereo_occ.decision import DecisionRule
from stereo_occ.inference_config import ExportConfig, ReconstructConfig
from stereo_occ.loggers.config import LoggerConfig
from stereo_occ.models.config import register_schemas as register_model_schemas
from stereo_occ.render.appearance import BackgroundConfig, LightsConfig, MaterialConfig
from stereo_occ.render.sensor import SensorConfig
from stereo_occ.render.texture import TextureConfig
from stereo_occ.report.config import ReportConfig
from stereo_occ.search.config import SearchConfig


class Resume(Enum):
    """What a run does with checkpoints already in its folder."""

    never = "never"
    auto = "auto"


@dataclass
class ScaleConfig:
    """How big everything is, in one place; other groups refer to it."""

    image_side: int = MISSING  # pixels
    views: int = MISSING  # stereo pairs per object
    counts: dict[str, int] = MISSING  # procedural objects per category
    points: int = MISSING  # query points per pair and step
    batch_size: int = MISSING  # pairs per step
    steps: int = MISSING  # optimiser steps
    decoder_hidden: int = MISSING
    decoder_blocks: int = MISSING
    disparities: int = MISSING  # cells of the one-sided correlation volume


@dataclass
class CategoriesConfig:
    """Which categories are used."""

    names: list[str] = MISSING


@dataclass
class PathsConfig:
    """Folders, relative to the working directory."""

    outputs: str = MISSING
    data: str = MISSING  # rendered shards


@dataclass
class PairsConfig:
    """What pairs there are: all that decides the content of the shards, and where they are."""

    data: DataConfig = MISSING
    rig: RigConfig = MISSING
    placement: PlacementConfig = MISSING
    lights: LightsConfig = MISSING
    material: MaterialConfig = MISSING
    texture: TextureConfig = field(default_factory=TextureConfig)  # runs of before there were any have none
    background: BackgroundConfig = MISSING
    sensor: SensorConfig = field(default_factory=SensorConfig)
    categories: CategoriesConfig = MISSING
    scale: ScaleConfig = MISSING
    paths: PathsConfig = MISSING
    workers: int = MISSING  # rendering processes; 0: one per core


@dataclass
class QueriesConfig:
    """Where the query points of a training step lie, as shares that add up to 1."""

    box: float = MISSING  # uniform in the object's bounding box: the paper's
    outside: float = MISSING  # uniform in the cube outside the box, known to be empty
    surface: float = MISSING  # near the surface


@dataclass
class OptimizerConfig:
    """Adam or AdamW."""

    name: str = MISSING
    lr: float = MISSING
    betas: list[float] = MISSING
    weight_decay: float = MISSING


@dataclass
class SchedulerConfig:
    """Learning rate over steps."""

    name: str = MISSING
    warmup: int = MISSING  # steps of linear warm-up
    final: float = MISSING  # last learning rate as a share of the first


@dataclass
class ValidationConfig:
    """When and how IoU is measured during training, and which state is kept."""

    interval: int = MISSING  # optimiser steps
    views: int = MISSING  # poses per validation object
    points: int = MISSING  # per view, for each of the box and the cube
    checkpoint_interval: int = MISSING  # steps between copies of the latest state
    keep_all: bool = MISSING  # keep the weights of every validation, not of the best one alone
    decision: DecisionRule = DecisionRule.fixed  # what the threshold that is chosen refers to


@dataclass
class TrainerConfig:
    """Hardware."""

    accelerator: str = MISSING
    devices: int = MISSING  # of each node, a training process for each; an evaluation is one process
    nodes: int = 1
    precision: str = MISSING  # auto: what is fast here
    threads: int | None = None  # of torch; null leaves torch's choice
    workers: int = MISSING  # loader processes
    gradient_clip: float | None = None

    @property
    def processes(self) -> int:
        """That train one model together."""
        return self.devices * self.nodes


@dataclass
class TrainConfig(PairsConfig):
    """``python -m stereo_occ.train``"""

    model: Any = MISSING
    control: ControlConfig = field(default_factory=ControlConfig)
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)
    auxiliary: AuxiliaryConfig = field(default_factory=AuxiliaryConfig)
    averaging: AveragingConfig = field(default_factory=AveragingConfig)
    queries: QueriesConfig = MISSING
    optimizer: OptimizerConfig = MISSING
    scheduler: SchedulerConfig = MISSING
    validation: ValidationConfig = MISSING
    trainer: TrainerConfig = MISSING
    logger: LoggerConfig = MISSING
    init: str | None = None  # checkpoint or weights to begin with
    seed: int = MISSING
    steps: int = MISSING
    points: int = MISSING
    batch_size: int = MISSING
    resume: Resume = MISSING
    progress: bool = MISSING


@dataclass
class EvaluateConfig:
    """``python -m stereo_occ.evaluate``; what is null is taken from the checkpoint."""

    checkpoint: str | None = (
        None  # of the network to measure; with a baseline, of the run whose data is meant
    )
    baseline: Any = None  # measured in place of a network
    training: list[str] = MISSING  # without a checkpoint: overrides of train.yaml that name the training data
    subset: str = MISSING  # train, val, test, all; auto: all of other meshes than the training's, else test
    views: int = MISSING  # poses per object
    points: int = MISSING  # per view and metric
    batch_size: int = MISSING  # views per forward pass
    meshes: int = MISSING  # poses per object whose mesh is measured; 0: none
    mesh_resolution: int = MISSING  # cells per side of the cube
    surface_points: int = MISSING  # on each surface
    examples: int = MISSING  # meshes and pictures per category
    keep: bool = (
        True  # mesh, truth and pair of each object's first view, for the report; needs meshes of 1 or more
    )
    data: Any = None
    rig: Any = None
    placement: Any = None
    lights: Any = None
    material: Any = None
    texture: Any = None
    background: Any = None
    sensor: Any = None
    categories: Any = None
    control: ControlConfig | None = None
    paths: PathsConfig = MISSING
    trainer: TrainerConfig = MISSING
    workers: int = MISSING
    progress: bool = MISSING


@dataclass
class InspectConfig(PairsConfig):
    """``python -m stereo_occ.inspect``"""

    progress: bool = True


@dataclass
class RenderConfig(PairsConfig):
    """``python -m stereo_occ.render``"""

    subset: str = "all"  # train, val, test or all
    slice: SliceConfig = field(default_factory=SliceConfig)
    verify: bool = False  # render nothing, compare what is there with its checksums
    progress: bool = field(default=True)


@cache
def register_schemas() -> None:
    """Tell Hydra the schemas, and OmegaConf two resolvers; safe to call again.

    ``divide`` is whole and at least 1, ``rest`` what shares leave of 1.
    """
    # Hydra would copy all schemas for each composition and each group that it lists; those it reads are copies anyway.
    ConfigStore.__deepcopy__ = lambda store, memo: store  # type: ignore[attr-defined]
    OmegaConf.register_new_resolver("divide", lambda a, b: max(1, int(a) // int(b)), replace=True)
    OmegaConf.register_new_resolver("rest", lambda *shares: 1 - sum(shares), replace=True)
    store = ConfigStore.instance()
    for name, root in (
        ("train", TrainConfig),
        ("render", RenderConfig),
        ("inspect", InspectConfig),
        ("evaluate", EvaluateConfig),
        ("reconstruct", ReconstructConfig),
        ("export", ExportConfig),
        ("report", ReportConfig),
    ):
        store.store(name=f"base_{name}", node=root)
    for group, schema in (
        ("rig", ToedInRigConfig),
        ("placement", PlacementConfig),
        ("lights", LightsConfig),
        ("material", MaterialConfig),
        ("texture", TextureConfig),
        ("background", BackgroundConfig),
        ("sensor", SensorConfig),
        ("categories", CategoriesConfig),
        ("scale", ScaleConfig),
        ("paths", PathsConfig),
        ("control", ControlConfig),
        ("augmentation", AugmentationConfig),
        ("auxiliary", AuxiliaryConfig),
        ("averaging", AveragingConfig),
        ("queries", QueriesConfig),
        ("optimizer", OptimizerConfig),
        ("scheduler", SchedulerConfig),
        ("validation", ValidationConfig),
        ("trainer", TrainerConfig),
        ("logger", LoggerConfig),
    ):
        store.store(group=group, name=f"base_{group}", node=schema)
    for name, data_schema in DATA_SCHEMAS.items():
        store.store(group="data", name=f"base_{name}", node=data_schema)
    for name, baseline_schema in BASELINE_SCHEMAS.items():
        store.store(group="baseline", name=f"base_{name}", node=baseline_schema)
    for kind, rig_schema in RIG_SCHEMAS.items():
        store.store(group="rig", name=f"base_{kind}_rig", node=rig_schema)
    store.store(group="hydra/sweeper", name="base_optuna", node=SearchConfig)
    register_model_schemas(store)
