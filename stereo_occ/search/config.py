"""Schema of ``hydra/sweeper=optuna``."""

from dataclasses import dataclass, field

from omegaconf import MISSING


@dataclass
class SearchConfig:
    """What is tried, and how often."""

    _target_: str = "hydra_plugins.stereo_occ_search.OptunaSweeper"
    n_trials: int = MISSING  # in all, those of earlier parts included
    n_jobs: int = MISSING  # at once, where the launcher can: each batch knows the results of those before
    n_startup_trials: int = MISSING  # drawn at random before the sampler learns from them
    seed: int = MISSING  # of the sampler
    storage: str = MISSING  # address of Optuna's data base
    params: dict[str, str] = field(
        default_factory=dict
    )  # key: interval(a,b), tag(log,interval(a,b)), choice(a,b,...)
