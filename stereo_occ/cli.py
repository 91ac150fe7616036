"""Entry points: Hydra with every configuration problem reported at once, one line each, before work starts."""

import functools
import sys
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches

import hydra
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from stereo_occ.config import register_schemas
from stereo_occ.errors import UserError
from stereo_occ.paths import conf_dir

Check = Callable[[DictConfig], list[str]]
HYDRA_FLAGS_WITHOUT_JOB = (
    "--help",
    "-h",
    "--hydra-help",
    "--version",
    "--cfg",
    "-c",
    "--info",
    "-i",
    "--shell-completion",
)


def entry_point(
    config_name: str, check: Check
) -> Callable[[Callable[[DictConfig], None]], Callable[[], None]]:
    """Turn ``task(cfg)`` into a command line program configured by ``conf/<config_name>.yaml``.

    A :class:`UserError` from the task, and every problem of the configuration, ends the program with one line each on
    standard error and exit code 2.
    """

    def decorate(task: Callable[[DictConfig], None]) -> Callable[[], None]:
        @functools.wraps(task)
        def guarded(cfg: DictConfig) -> None:
            try:
                task(cfg)
            except UserError as error:
                _stop([str(error)])

        register_schemas()
        run_hydra = hydra.main(version_base="1.3", config_path=str(conf_dir()), config_name=config_name)(
            guarded
        )

        def main() -> None:
            arguments = sys.argv[1:]
            if not any(argument.split("=")[0] in HYDRA_FLAGS_WITHOUT_JOB for argument in arguments):
                problems = find_problems(config_name, [a for a in arguments if not a.startswith("-")], check)
                if problems:
                    _stop(problems)
            run_hydra()

        return main

    return decorate


def compose_config(config_name: str, overrides: Sequence[str] = ()) -> DictConfig:
    """The configuration that a command line would give, with :class:`UserError` listing all problems."""
    register_schemas()
    problems = find_problems(config_name, overrides, lambda cfg: [])
    if problems:
        raise UserError("; ".join(problems))
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        return compose(config_name, list(overrides))


def find_problems(config_name: str, overrides: Sequence[str], check: Check) -> list[str]:
    """Every problem of a command line (or sweep), one line each; empty if there is none."""
    register_schemas()
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        try:
            choices = [_choices(o) for o in OverridesParser.create().parse_overrides(list(overrides))]
        except HydraException as error:
            return [_one_line(error)]
        first = [choice[0] for choice in choices]
        jobs = [first]
        for swept, choice in enumerate(choices):
            jobs += [[*first[:swept], value, *first[swept + 1 :]] for value in choice[1:]]
        found = (problem for job in jobs for problem in _problems_of_job(config_name, job, check))
        return list(dict.fromkeys(found))


def _problems_of_job(config_name: str, overrides: list[str], check: Check) -> list[str]:
    try:
        cfg = compose(config_name, overrides)
    except (HydraException, OmegaConfBaseException):
        return _problems_one_by_one(config_name, overrides)
    try:
        missing = sorted(OmegaConf.missing_keys(cfg))
    except OmegaConfBaseException as error:
        return [_one_line(error)]
    return [f"{key}: no value given; add {key}=..." for key in missing] or check(cfg)


def _problems_one_by_one(config_name: str, overrides: list[str]) -> list[str]:
    """Try the overrides of groups first, then each value on top of the groups that compose."""
    problems: list[str] = []
    loader = GlobalHydra.instance().config_loader()
    is_group = [bool(loader.get_group_options(_key(override))) for override in overrides]
    good: list[str] = []
    for override in (o for o, group in zip(overrides, is_group, strict=True) if group):
        try:
            compose(config_name, [*good, override])
            good.append(override)
        except (HydraException, OmegaConfBaseException) as error:
            key, _, value = override.partition("=")
            options = loader.get_group_options(_key(override))
            problems.append(
                f"{key}: unknown choice {value!r}; {nearest(value, options)}"
                if value not in options
                else _one_line(error)
            )
    base = compose(config_name, good)
    for override in (o for o, group in zip(overrides, is_group, strict=True) if not group):
        try:
            compose(config_name, [*good, override])
        except (HydraException, OmegaConfBaseException) as error:
            key = _key(override)
            known = _keys(base)
            problems.append(
                f"{override}: {_one_line(error)}"
                if key in known
                else f"{key}: unknown key; {nearest(key, known)}"
            )
    return problems


def nearest(name: str, known: Iterable[str]) -> str:
    """Advice on a misspelt name: the nearest known ones, or all of them."""
    known = sorted(known)
    close = get_close_matches(name, known, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else f"known: {', '.join(known[:20])}"


def _choices(override: Override) -> list[str]:
    """The single values of a sweep override, or the override itself."""
    if not override.is_sweep_override():
        return [str(override.input_line)]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]


def _key(override: str) -> str:
    return override.partition("=")[0].lstrip("+~").partition("@")[0]


def _keys(cfg: DictConfig, prefix: str = "") -> list[str]:
    keys = []
    for key in map(str, cfg):
        full = f"{prefix}{key}"
        keys.append(full)
        child = cfg._get_node(key)
        if isinstance(child, DictConfig) and not (child._is_none() or child._is_missing()):
            keys += _keys(child, f"{full}.")
    return keys


def _one_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error.__cause__ or error).splitlines()]
    return "; ".join(line for line in lines if line and not line.startswith("object_type"))


def _stop(problems: list[str]) -> None:
    for problem in problems:
        sys.stderr.write(f"stereo_occ: {problem}\n")
    raise SystemExit(2)
