"""Keeps off the terminal what libraries say about themselves and what does not apply here."""

import logging
import warnings

#: Beginnings of warnings, each with the reason why it does not apply.
BESIDE_THE_POINT = (
    # Checkpoints lie in the run folder, which Hydra has made and a resumed run goes on with.
    "Checkpoint directory .* exists and is not empty",
    # The order of the data is a pure function of seed and step.
    "You're resuming from a checkpoint that ended before the epoch ended",
    # On a few cores loading in this process is faster.
    r"The '\w+_dataloader' does not have many workers",
    # Jobs go to Slurm through Hydra's launcher, not through srun; elsewhere a run does not care that there is Slurm.
    "The `srun` command is available on your system but is not used",
    # Metrics are of all processes' views before they are logged.
    "It is recommended to use `self.log",
    # Lightning's own use of torch.
    "`isinstance\\(treespec, LeafSpec\\)` is deprecated",
)


def quiet_libraries() -> None:
    """Silence notes on hardware and on how a mesh was read, advertisements, and the warnings listed above."""
    for library in ("lightning.pytorch", "trimesh"):
        logging.getLogger(library).setLevel(logging.WARNING)
    for beginning in BESIDE_THE_POINT:
        warnings.filterwarnings("ignore", beginning)
