"""The loop of a search: ask for trials, launch them, tell what they returned."""

import logging
from collections.abc import Sequence
from pathlib import Path

from hydra.core.utils import JobStatus
from hydra.plugins.launcher import Launcher

from stereo_occ.errors import UserError
from stereo_occ.search.config import SearchConfig
from stereo_occ.search.results import write_results
from stereo_occ.search.space import search_space
from stereo_occ.search.study import Search, overrides_of

#: What ``python -m stereo_occ.train`` returns.
OBJECTIVE = "val/iou"

logger = logging.getLogger(__name__)


def sweep(config: SearchConfig, arguments: Sequence[str], launcher: Launcher, folder: Path) -> None:
    """Run the trials that are missing, each as job of its own number, and write what was found into ``folder``.

    Args:
        arguments: the overrides of the command line, which go before ``config.params``.

    Raises:
        UserError: the search cannot begin, or a job elsewhere has failed for a reason the user can put right; the other
            trials have run.
    """
    for key in ("n_trials", "n_jobs", "n_startup_trials"):
        if getattr(config, key) < 1:
            raise UserError(f"hydra.sweeper.{key}={getattr(config, key)}: must be at least 1")
    params = [f"{key}={value}" for key, value in config.params.items()]
    space, fixed = search_space([*params, *arguments])
    search = Search(config, space, fixed)
    failure: UserError | None = None
    for batch in search.batches():
        jobs = [(*fixed, *overrides_of(trial)) for trial in batch]
        for trial, job in zip(batch, launcher.launch(jobs, initial_job_idx=batch[0].number), strict=True):
            value = job._return_value
            if job.status is not JobStatus.COMPLETED:
                if not isinstance(value, UserError):
                    raise value  # the trial is open still, and is run when the search goes on
                failure = failure or value
            search.tell(trial, value)
        write_results(folder, search.trials, search.best, space, OBJECTIVE)
        logger.info("%d of %d trials; best so far: %s", len(search.trials), config.n_trials, _best(search))
    write_results(folder, search.trials, search.best, space, OBJECTIVE)
    logger.info(
        "best of %d trials: %s; all are in %s", len(search.trials), _best(search), folder / "trials.csv"
    )
    if failure is not None:
        raise failure


def _best(search: Search) -> str:
    best = search.best
    if best is None:
        return "none has ended well"
    return f"{OBJECTIVE} {best.value:.4f} of trial {best.number}, {' '.join(overrides_of(best))}"
