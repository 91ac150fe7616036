"""A search that can be stopped at any moment and goes on: its trials are in Optuna's data base.

A trial that was running when the search was stopped is started again in its own folder, where a training goes on from
its latest checkpoint. Each trial is drawn with a seed of its own, so stops change nothing of a search one by one.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import optuna
from optuna.distributions import BaseDistribution, distribution_to_json
from optuna.samplers import TPESampler
from optuna.trial import FrozenTrial, TrialState
from sqlalchemy.exc import SQLAlchemyError

from stereo_occ.errors import UserError
from stereo_occ.search.config import SearchConfig

#: Keys and groups that may differ between the parts of a search: where it runs and what it writes.
FREE = ("paths", "workers", "trainer", "logger", "progress", "resume")
SQLITE = "sqlite:///"


class Search:
    """Trials of one search space that maximise what they return.

    Args:
        space: what is searched, by key.
        fixed: the overrides that every trial has.

    Raises:
        UserError: the data base holds a search of something else, or cannot be opened.
    """

    def __init__(
        self, config: SearchConfig, space: Mapping[str, BaseDistribution], fixed: Sequence[str]
    ) -> None:
        self.config, self.space = config, dict(space)
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        try:
            if config.storage.startswith(SQLITE):
                Path(config.storage.removeprefix(SQLITE)).parent.mkdir(parents=True, exist_ok=True)
            self.study = optuna.create_study(
                study_name="search", storage=config.storage, direction="maximize", load_if_exists=True
            )
        except (SQLAlchemyError, OSError, ImportError, optuna.exceptions.StorageInternalError) as error:
            reason = str(error).splitlines()[0]
            raise UserError(
                f"hydra.sweeper.storage={config.storage}: cannot be opened ({reason}); say "
                f"hydra.sweeper.storage=sqlite:///FILE, where no other file is"
            ) from error
        self._keep_to({key: distribution_to_json(value) for key, value in space.items()}, fixed)

    def _keep_to(self, space: Mapping[str, str], fixed: Sequence[str]) -> None:
        subject = {
            "space": dict(space),
            "fixed": sorted(line for line in fixed if line.partition("=")[0].partition(".")[0] not in FREE),
        }
        former = self.study.user_attrs.get("subject")
        if former is None:
            self.study.set_user_attr("subject", subject)
        elif former != subject:
            raise UserError(
                f"{self.config.storage}: holds a search of other settings; choose another hydra.sweep.dir"
            )

    @property
    def trials(self) -> list[FrozenTrial]:
        """All trials so far, by their number."""
        return self.study.get_trials(deepcopy=False)

    def batches(self) -> Iterator[list[FrozenTrial]]:
        """What to run next, at most ``n_jobs`` trials at once with numbers that follow each other.

        First those that were stopped, then new ones until there are ``n_trials``.
        """
        for trial in self.trials:
            if trial.state is TrialState.RUNNING:
                yield [trial]
        while (missing := self.config.n_trials - len(self.trials)) > 0:
            numbers = [self._ask() for _ in range(min(missing, self.config.n_jobs))]
            yield [trial for trial in self.trials if trial.number in numbers]

    def _ask(self) -> int:
        number = len(self.trials)
        self.study.sampler = TPESampler(
            n_startup_trials=self.config.n_startup_trials,
            seed=(1_000_003 * self.config.seed + number) % 2**32,  # NumPy's seeds have 32 bits
        )
        return self.study.ask(fixed_distributions=self.space).number

    def tell(self, trial: FrozenTrial, value: object) -> None:
        """The result of a trial; whatever is no finite number counts as failed."""
        if isinstance(value, (int, float)) and math.isfinite(value):
            self.study.tell(trial.number, float(value))
        else:
            self.study.tell(trial.number, state=TrialState.FAIL)

    @property
    def best(self) -> FrozenTrial | None:
        """The best trial, if any has ended well."""
        complete = [trial for trial in self.trials if trial.state is TrialState.COMPLETE]
        return max(complete, key=lambda trial: trial.value or 0.0, default=None)


def overrides_of(trial: FrozenTrial) -> list[str]:
    """A trial's settings as they are given on the command line."""
    return [f"{key}={value}" for key, value in trial.params.items()]
