"""The loggers that a configuration asks for."""

from pathlib import Path

from stereo_occ.loggers.board import Board
from stereo_occ.loggers.config import LoggerConfig


def build_boards(config: LoggerConfig, folder: Path, step: int) -> list[Board]:
    """A board for each logger, for a run in ``folder`` that continues from ``step``."""
    boards: list[Board] = []
    if config.tensorboard:
        from stereo_occ.loggers.tensorboard import TensorBoard

        boards.append(TensorBoard(folder / "tensorboard", step))
    if config.csv:
        from stereo_occ.loggers.csv_file import CsvFile

        boards.append(CsvFile(folder, step))
    if config.wandb is not None:
        from stereo_occ.loggers.wandb import Wandb

        boards.append(Wandb(config.wandb, folder, folder.name, step))
    if config.mlflow is not None:
        from stereo_occ.loggers.mlflow import Mlflow

        boards.append(Mlflow(config.mlflow, folder, folder.name, step))
    return boards
