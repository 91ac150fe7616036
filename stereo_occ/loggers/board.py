"""What every logger of a training takes."""

from abc import abstractmethod
from argparse import Namespace
from collections.abc import Mapping
from typing import Any, ClassVar

from lightning.pytorch.loggers import Logger
from numpy.typing import NDArray
from torch import Tensor
from trimesh import Trimesh

from stereo_occ.flat import flat

Scalar = str | int | float | bool


class Board(Logger):
    """A logger for scalars and settings, and for pictures, meshes and curves where its service has a place for them.

    Steps are those taken; Lightning counts the first one as 0.

    Attributes:
        shows: whether it has a place for pictures, meshes and curves.
    """

    shows: ClassVar[bool] = True

    @property
    def name(self) -> str:
        return type(self).__name__

    @property
    def version(self) -> str:
        return ""

    def log_metrics(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        scalars = {name: float(value) for name, value in metrics.items() if name != "epoch"}
        if scalars:
            self.scalars(scalars, 0 if step is None else step + 1)

    def log_hyperparams(self, params: dict[str, Any] | Namespace, *args: Any, **kwargs: Any) -> None:
        self.settings(flatten(vars(params) if isinstance(params, Namespace) else params))

    @abstractmethod
    def scalars(self, values: Mapping[str, float], step: int) -> None:
        """Points of curves."""

    @abstractmethod
    def settings(self, values: Mapping[str, Scalar]) -> None:
        """The run's hyper-parameters, by dotted key."""

    def picture(self, name: str, image_HW3: NDArray[Any], step: int) -> None:
        """An RGB picture of bytes."""

    def mesh(self, name: str, mesh: Trimesh, step: int) -> None:
        """A mesh that is not empty."""

    def answers(self, name: str, probability_N: Tensor, occupied_N: Tensor, step: int) -> None:
        """Predicted probabilities beside the truth, for a curve that can be explored."""


def flatten(config: Mapping[str, Any]) -> dict[str, Scalar]:
    """Nested dictionaries to dotted keys with scalar values."""
    return {
        key: value if isinstance(value, (int, float, bool)) else str(value)
        for key, value in flat(config).items()
    }
