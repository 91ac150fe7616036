"""MLflow: curves, settings; pictures and meshes as artifacts."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from trimesh import Trimesh

from stereo_occ.errors import UserError
from stereo_occ.loggers.board import Board, Scalar
from stereo_occ.loggers.config import MlflowConfig
from stereo_occ.loggers.sent import Sent

if TYPE_CHECKING:
    from mlflow import MlflowClient

#: MLflow's limits: characters of a setting's value, settings in one request.
LONGEST, AT_ONCE = 500, 100

SQLITE = "sqlite:///"


class Mlflow(Board):
    """A run of MLflow, on a server or in an SQLite file that many runs share.

    Args:
        name: shown for the run.
        step: that the run continues from.
    """

    def __init__(self, config: MlflowConfig, folder: Path, name: str, step: int) -> None:
        super().__init__()
        self.config, self.title = config, name
        self.sent = Sent(folder / "mlflow.json", step)

    @cached_property
    def client(self) -> MlflowClient:
        """The service, with the run begun or continued.

        Raises:
            UserError: it cannot be reached.
        """
        from mlflow import MlflowClient, MlflowException  # optional, and takes seconds

        address = self.config.tracking_uri
        if address.startswith(SQLITE):
            Path(address.removeprefix(SQLITE)).parent.mkdir(parents=True, exist_ok=True)
        try:
            client = MlflowClient(address)
            if self.sent.begins:
                run = client.create_run(self._experiment(client), run_name=self.title)
                self.sent.begin(run.info.run_id)
            else:
                client.update_run(self.run_id, status="RUNNING")
        except MlflowException as error:
            raise UserError(
                f"logger.mlflow.tracking_uri={address}: MLflow says: {str(error).splitlines()[0]}"
            ) from error
        return client

    @property
    def run_id(self) -> str:
        """The run's id at the service."""
        assert self.sent.id is not None
        return self.sent.id

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        from mlflow.entities import Metric

        client, now = self.client, int(time.time() * 1000)
        if new := self.sent.new(values, step):
            client.log_batch(self.run_id, metrics=[Metric(name, values[name], now, step) for name in new])
            self.sent.mark(new, step)

    def settings(self, values: Mapping[str, Scalar]) -> None:
        """Once: MLflow refuses other values later, and a resumed run may be made longer."""
        from mlflow.entities import Param

        if not self.sent.begins:
            return
        params = [Param(name, str(value)[:LONGEST]) for name, value in values.items()]
        client = self.client
        for first in range(0, len(params), AT_ONCE):
            client.log_batch(self.run_id, params=params[first : first + AT_ONCE])

    def picture(self, name: str, image_HW3: NDArray[np.uint8], step: int) -> None:
        self._artifact(name, step, "png", lambda path: Image.fromarray(image_HW3).save(path))

    def mesh(self, name: str, mesh: Trimesh, step: int) -> None:
        self._artifact(name, step, "glb", mesh.export)

    def finalize(self, status: str) -> None:
        if "client" in vars(self):
            self.client.set_terminated(self.run_id, "FINISHED" if status == "success" else "FAILED")

    def _artifact(self, name: str, step: int, suffix: str, write: Callable[[Path], object]) -> None:
        client = self.client
        if self.sent.new([name], step):
            with TemporaryDirectory() as folder:
                path = Path(folder) / f"step_{step:06d}.{suffix}"
                write(path)
                client.log_artifact(self.run_id, str(path), name)
            self.sent.mark([name], step)

    def _experiment(self, client: MlflowClient) -> str:
        known = client.get_experiment_by_name(self.config.experiment)
        if known is not None:
            return str(known.experiment_id)
        artifacts = self.config.artifacts
        location = None if artifacts is None else Path(artifacts).resolve().as_uri()
        return str(client.create_experiment(self.config.experiment, location))
