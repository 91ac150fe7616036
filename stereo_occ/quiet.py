"""Keeps off the terminal what Lightning says about itself and what does not apply here."""

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
    # Lightning's own use of torch.
    "`isinstance\\(treespec, LeafSpec\\)` is deprecated",
)


def quiet_lightning() -> None:
    """Silence Lightning's notes on hardware, its advertisements, and the warnings listed above."""
    logging.getLogger("lightning.pytorch").setLevel(logging.WARNING)
    for beginning in BESIDE_THE_POINT:
        warnings.filterwarnings("ignore", beginning)
