"""TensorBoard: curves, pictures, meshes that turn, precision and recall, a table of hyper-parameters."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.tensorboard import SummaryWriter
from torch.utils.tensorboard.summary import hparams
from trimesh import Trimesh

from stereo_occ.loggers.board import Board, Scalar

#: The columns of the table of runs beside the settings; it reads the values from the curves.
TABLE_METRICS = ("val/iou", "val/iou_bbox", "val/iou_unrotated", "val/loss")


class TensorBoard(Board):
    """Event files in ``folder``.

    Args:
        step: that the run continues from; what an earlier part has logged after it is forgotten.
    """

    def __init__(self, folder: Path, step: int) -> None:
        super().__init__()
        self.writer = SummaryWriter(folder, purge_step=step + 1)

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        for name, value in values.items():
            self.writer.add_scalar(name, value, step)

    def settings(self, values: Mapping[str, Scalar]) -> None:
        # torch's add_hparams would write values of its own into a folder of its own.
        for summary in hparams(dict(values), dict.fromkeys(TABLE_METRICS, 0.0)):  # type: ignore[no-untyped-call]
            self.writer._get_file_writer().add_summary(summary)  # type: ignore[no-untyped-call]

    def picture(self, name: str, image_HW3: NDArray[np.uint8], step: int) -> None:
        self.writer.add_image(name, image_HW3, step, dataformats="HWC")

    def mesh(self, name: str, mesh: Trimesh, step: int) -> None:
        """Coloured by the direction of the surface, as normal maps are."""
        colors = (127.5 * (np.asarray(mesh.vertex_normals) + 1)).astype(np.uint8)
        arrays = (mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), colors)
        vertices_1V3, faces_1F3, colors_1V3 = (torch.from_numpy(array)[None] for array in arrays)
        self.writer.add_mesh(name, vertices_1V3, colors=colors_1V3, faces=faces_1F3, global_step=step)

    def answers(self, name: str, probability_N: Tensor, occupied_N: Tensor, step: int) -> None:
        self.writer.add_pr_curve(name, occupied_N, probability_N, step)

    def save(self) -> None:
        self.writer.flush()

    def finalize(self, status: str) -> None:
        self.writer.close()
