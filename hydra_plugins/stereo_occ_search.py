"""What makes Hydra find ``hydra/sweeper=optuna``: it takes sweepers from this name space alone, and reads all of it at
every start, so that the work is elsewhere."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hydra.core.plugins import Plugins
from hydra.plugins.launcher import Launcher
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class OptunaSweeper(Sweeper):
    """Lets Optuna choose the settings of each job; see ``stereo_occ/search``."""

    launcher: Launcher
    folder: Path

    def __init__(self, **settings: Any) -> None:
        self.settings = settings

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Called by Hydra before :meth:`sweep`."""
        self.launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )
        self.folder = Path(config.hydra.sweep.dir)

    def sweep(self, arguments: list[str]) -> None:
        """Run the search."""
        from stereo_occ.errors import UserError
        from stereo_occ.search.config import SearchConfig

        if find_spec("optuna") is None:
            raise UserError("hydra/sweeper=optuna: needs the extra search; pip install 'stereo-occ[search]'")
        from stereo_occ.search.sweep import sweep

        sweep(SearchConfig(**self.settings), arguments, self.launcher, self.folder)
