"""Weights & Biases: curves, pictures, meshes that turn, settings. Offline unless asked otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.loggers.board import Board, Scalar
from stereo_occ.loggers.config import WandbConfig
from stereo_occ.loggers.sent import Sent

if TYPE_CHECKING:
    from wandb import Run


class Wandb(Board):
    """A run of Weights & Biases, with its files in ``folder/wandb``.

    A resumed run has the same id. Offline that is one folder for each part, which ``wandb sync`` puts together.

    Args:
        name: shown for the run.
        step: that the run continues from.
    """

    def __init__(self, config: WandbConfig, folder: Path, name: str, step: int) -> None:
        super().__init__()
        self.config, self.folder, self.title = config, folder, name
        self.sent = Sent(folder / "wandb" / "sent.json", step)

    @cached_property
    def run(self) -> Run:
        """The run, begun or continued.

        Raises:
            UserError: Weights & Biases cannot be reached, or knows nobody here.
        """
        import wandb  # optional, and takes seconds

        try:
            return wandb.init(
                project=self.config.project,
                entity=self.config.entity,
                mode=self.config.mode.value,
                id=self.sent.id or self.sent.begin(),
                name=self.title,
                dir=self.folder,
                resume="allow",
                reinit="create_new",  # each run of a sweep in one process is one of its own
                settings=wandb.Settings(silent=True, console="off"),
            )
        except wandb.Error as error:
            raise UserError(
                f"logger.wandb.mode={self.config.mode.value}: Weights & Biases says: {str(error).splitlines()[0]}; "
                f"run `wandb login`, or leave the mode offline"
            ) from error

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        self._send(dict(values), step)

    def settings(self, values: Mapping[str, Scalar]) -> None:
        self.run.config.update(dict(values), allow_val_change=True)

    def picture(self, name: str, image_HW3: NDArray[np.uint8], step: int) -> None:
        from wandb import Image

        self._send({name: Image(image_HW3)}, step)

    def mesh(self, name: str, mesh: Trimesh, step: int) -> None:
        from wandb import Object3D

        with TemporaryDirectory() as folder:
            path = Path(folder) / "mesh.glb"
            mesh.export(path)
            self._send({name: Object3D(str(path))}, step)

    def finalize(self, status: str) -> None:
        if "run" in vars(self):
            self.run.finish(exit_code=0 if status == "success" else 1)

    def _send(self, values: dict[str, Any], step: int) -> None:
        if new := self.sent.new(values, step):
            self.run.log({name: values[name] for name in new}, step=step)
            self.sent.mark(new, step)
