"""Schemas of the configuration group ``logger``, and what they need that may not be installed."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from importlib.util import find_spec

from omegaconf import MISSING


class WandbMode(Enum):
    """Whether a run is sent while it is made."""

    offline = "offline"
    online = "online"


@dataclass
class WandbConfig:
    """Weights & Biases."""

    project: str = "stereo-occ"
    entity: str | None = None  # user or team; null: the account's own
    mode: WandbMode = WandbMode.offline  # offline: files in the run folder, for `wandb sync`


@dataclass
class MlflowConfig:
    """MLflow."""

    tracking_uri: str = MISSING  # of a server, or sqlite:///FILE
    experiment: str = "stereo-occ"
    artifacts: str | None = None  # folder of pictures and meshes; null: the server's


@dataclass
class LoggerConfig:
    """What is written while training; any of the four together."""

    tensorboard: bool = MISSING
    interval: int = MISSING  # steps between training losses
    examples: int = MISSING  # pairs and meshes shown per category
    mesh_resolution: int = MISSING  # cells per side of the shown meshes
    csv: bool = False
    wandb: WandbConfig | None = None
    mlflow: MlflowConfig | None = None


#: Packages that must be there for a logger.
PACKAGES = {"wandb": ("wandb",), "mlflow": ("mlflow", "sqlalchemy", "alembic")}


def logger_problems(config: LoggerConfig) -> Iterator[str]:
    """Loggers that are asked for and not installed, one line each."""
    for extra, packages in PACKAGES.items():
        missing = [package for package in packages if find_spec(package) is None]
        if getattr(config, extra) is not None and missing:
            yield f"logger.{extra}: needs the package {missing[0]}; pip install 'stereo-occ[{extra}]'"
