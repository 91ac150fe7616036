"""Entry points: Hydra with every problem reported at once, one line each, before work starts."""

import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import hydra
from hydra._internal.utils import get_args_parser
from omegaconf import DictConfig

from stereo_occ.config import register_schemas
from stereo_occ.errors import UserError
from stereo_occ.paths import conf_dir
from stereo_occ.problems import Check, find_problems

# With these Hydra shows something and runs no job.
ONLY_SHOWS = ("help", "hydra_help", "cfg", "info", "shell_completion")


def entry_point(
    config_name: str, check: Check
) -> Callable[[Callable[[DictConfig], None]], Callable[[], None]]:
    """Turn ``task(cfg)`` into a command line program configured by ``conf/<config_name>.yaml``.

    Every problem of the configuration ends the program before it starts, with one line each on standard error and
    exit code 2. So does a :class:`UserError` of the task; of a sweep the other jobs still run.
    """

    def decorate(task: Callable[[DictConfig], None]) -> Callable[[], None]:
        failures: list[str] = []

        @functools.wraps(task)
        def guarded(cfg: DictConfig) -> None:
            try:
                task(cfg)
            except UserError as error:
                failures.append(str(error))
                _report([str(error)])

        register_schemas()
        run_hydra = hydra.main(version_base="1.3", config_path=str(conf_dir()), config_name=config_name)(
            guarded
        )

        def main() -> None:
            arguments = get_args_parser().parse_args()
            if not any(getattr(arguments, name) for name in ONLY_SHOWS):
                problems = find_problems(
                    arguments.config_name or config_name,
                    arguments.overrides,
                    check,
                    multirun=arguments.multirun,
                    config_dir=Path(arguments.config_dir) if arguments.config_dir else None,
                )
                if problems:
                    _report(problems)
                    raise SystemExit(2)
            run_hydra()
            if failures:
                raise SystemExit(2)

        return main

    return decorate


def compose_config(config_name: str, overrides: Sequence[str] = ()) -> DictConfig:
    """The configuration that a command line would give, with :class:`UserError` listing all problems."""
    composed: list[DictConfig] = []

    def keep(cfg: DictConfig) -> list[str]:
        composed.append(cfg)
        return []

    problems = find_problems(config_name, overrides, keep, multirun=False)
    if problems:
        raise UserError("; ".join(problems))
    return composed[0]


def _report(problems: Sequence[str]) -> None:
    for problem in problems:
        sys.stderr.write(f"stereo_occ: {problem}\n")
