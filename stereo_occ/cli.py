"""Entry points: Hydra with every problem reported at once, one line each, before work starts."""

import functools
import os
import re
import sys
import warnings
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import InterpolationKeyError

from stereo_occ.config import register_schemas
from stereo_occ.errors import UserError
from stereo_occ.models.extension import load_extensions
from stereo_occ.paths import conf_dir
from stereo_occ.printable import printable
from stereo_occ.problems import Check, find_problems
from stereo_occ.run_folder import claimed, remove_traces
from stereo_occ.system_errors import one_line
from stereo_occ.watched_output import watched_output

# With these Hydra shows something and runs no job.
ONLY_SHOWS = ("help", "hydra_help", "cfg", "info", "shell_completion")

#: Launchers of ``conf/hydra/launcher`` and what they need.
LAUNCHERS = {
    "joblib": "hydra_plugins.hydra_joblib_launcher",
    "submitit_slurm": "hydra_plugins.hydra_submitit_launcher",
}

# Said of the files in conf/hydra/launcher, which are meant to be merged with the schema of the same name.
warnings.filterwarnings("ignore", r"\s*'hydra/launcher/\w+' is validated against ConfigStore schema")


def entry_point(
    config_name: str, check: Check, aliases: Mapping[str, str] | None = None
) -> Callable[[Callable[[DictConfig], object]], Callable[[], None]]:
    """Turn ``task(cfg)`` into a command line program configured by ``conf/<config_name>.yaml``.

    Every problem of the configuration ends the program before it starts, with one line each on standard error and
    exit code 2. So does a :class:`UserError` of the task, or what the system refuses it, such as space on a full disk;
    a run folder that it has left nothing in is removed. Of a sweep the other jobs still run, in this process or where a
    launcher runs them.

    What the task returns is what a sweeper that searches maximises.

    Args:
        aliases: other names of keys, for those that have the name of a group.
    """

    def decorate(task: Callable[[DictConfig], object]) -> Callable[[], None]:
        failures: list[str] = []

        def refuse(problem: str) -> None:
            if problem not in failures:
                failures.append(problem)
                _report([problem])

        @functools.wraps(task)
        def guarded(cfg: DictConfig) -> object:
            register_schemas()  # a launcher's process does not know them yet
            folder = Path(HydraConfig.get().runtime.output_dir)
            try:
                with claimed(folder), _traces_removed(folder):
                    load_extensions()
                    return task(cfg)
            except Exception as error:
                problem = one_line(error)
                if _runs_elsewhere():
                    raise UserError(problem) from error  # Hydra brings it back to the process of the sweep
                refuse(problem)
                return None

        register_schemas()
        run_hydra = hydra.main(version_base="1.3", config_path=str(conf_dir()), config_name=config_name)(
            guarded
        )

        def main() -> None:
            failures.clear()  # of an earlier call in the same process
            sys.argv[1:] = [_by_key(argument, aliases or {}) for argument in sys.argv[1:]]
            arguments = get_args_parser().parse_args()
            try:
                load_extensions()
                shows = any(getattr(arguments, name) for name in ONLY_SHOWS)
                problems = _refused_flags(arguments) or _missing_launchers(arguments.overrides)
                problems = problems or find_problems(
                    config_name,
                    arguments.overrides,
                    None if shows else check,
                    multirun=arguments.multirun,
                    config_dir=Path(arguments.config_dir) if arguments.config_dir else None,
                )
                if problems:
                    _report([_by_alias(problem, aliases or {}) for problem in problems])
                    raise SystemExit(2)
                with _errors_raised(), watched_output(refuse):
                    run_hydra()
            except InterpolationKeyError as error:
                if not arguments.resolve:
                    raise
                refuse(f"--resolve: {error}, which a checkpoint gives; leave --resolve out")
            except Exception as error:
                refuse(one_line(error))
            if failures:
                raise SystemExit(2)

        return main

    return decorate


@contextmanager
def _traces_removed(folder: Path) -> Iterator[None]:
    """Where what is done in the context fails, remove the run folder that it has left nothing in."""
    try:
        yield
    except Exception:
        remove_traces(folder)
        raise


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


def _by_key(argument: str, aliases: Mapping[str, str]) -> str:
    key, equals, value = argument.partition("=")
    return f"{aliases[key]}={value}" if equals and key in aliases else argument


def _by_alias(problem: str, aliases: Mapping[str, str]) -> str:
    for alias, key in aliases.items():
        problem = re.sub(rf"\b{key}(?=[:=])", alias, problem)
    return problem


def _runs_elsewhere() -> bool:
    hydra_cfg = HydraConfig.get()
    return hydra_cfg.mode is RunMode.MULTIRUN and not hydra_cfg.launcher._target_.endswith(".BasicLauncher")


def _refused_flags(arguments: Namespace) -> list[str]:
    """Of Hydra's flags, those that would leave out the checks or run code that a file holds, or that name nothing."""
    flags = {
        "--config-path": (
            arguments.config_path,
            "the settings are this package's own; add yours with --config-dir",
        ),
        "--config-name": (
            arguments.config_name,
            "each program has its own settings; add yours with --config-dir",
        ),
        "--experimental-rerun": (
            arguments.experimental_rerun,
            "a pickled job can run any code; type the command",
        ),
    }
    if arguments.config_dir and not Path(arguments.config_dir).is_dir():
        flags["--config-dir"] = (
            arguments.config_dir,
            "no such folder; give one such as DIR of DIR/experiment/mine.yaml",
        )
    return [f"{flag} {value}: {remedy}" for flag, (value, remedy) in flags.items() if value]


def _missing_launchers(overrides: Sequence[str]) -> list[str]:
    return [
        f"{override}: needs the extra cluster; pip install 'stereo-occ[cluster]'"
        for override in overrides
        for name, package in LAUNCHERS.items()
        if override == f"hydra/launcher={name}" and find_spec(package) is None
    ]


@contextmanager
def _errors_raised() -> Iterator[None]:
    """Let Hydra raise what went wrong, where it would print it and exit."""
    before = os.environ.get("HYDRA_FULL_ERROR")
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = before


def _report(problems: Sequence[str]) -> None:
    for problem in problems:
        sys.stderr.write(f"stereo_occ: {printable(problem)}\n")
