"""Schema of the configuration of ``report``."""

from dataclasses import dataclass
from typing import Any

from omegaconf import MISSING


@dataclass
class ReportConfig:
    """``python -m stereo_occ.report``"""

    runs: Any = (
        MISSING  # folders of evaluations, or patterns of such; seeds of one model are found to be that
    )
    output: str = MISSING  # .html; a .md and a folder of figures go beside it
    title: str = MISSING
    focus: str | None = (
        None  # label of the model that is looked at closely; null: the best one that uses the pair
    )
    against: str | None = None  # what it is set against; null: the best one that sees one image
    draws: int = MISSING  # of the bootstrap
