"""What is wrong with a command line: every problem at once, one line each with the key, its value and a remedy."""

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, Node, OmegaConf, open_dict
from omegaconf.errors import (
    InterpolationKeyError,
    InterpolationToMissingValueError,
    OmegaConfBaseException,
)
from yaml import YAMLError

from stereo_occ.advice import expected_value, nearest, one_line, unknown_key
from stereo_occ.config import register_schemas
from stereo_occ.foreign_code import code_named
from stereo_occ.paths import conf_dir

Check = Callable[[DictConfig], list[str]]

#: From overrides to the configuration, Hydra's own part included; for the same overrides the same object.
Compositions = Callable[[tuple[str, ...]], DictConfig]

# Hydra itself raises ValueError for a group without a choice: model=null; OmegaConf AssertionError for a key below a
# group of which there is none: control.degrees=3; YAMLError comes from files of one's own.
COMPOSITION_ERRORS = (HydraException, OmegaConfBaseException, ValueError, AssertionError, YAMLError)

#: Whole numbers are at most this: seeds have 32 bits, and nothing that is counted is as many.
LARGEST = 2**32 - 1

NO_SUCH_KEY = "refers to a key that does not exist"

#: Where files of one's own are.
SEARCHPATH = "hydra.searchpath"


@contextmanager
def _composing() -> Iterator[None]:
    """Hydra for compositions, also within a program that Hydra runs."""
    running, GlobalHydra.instance().hydra = GlobalHydra.instance().hydra, None
    try:
        with initialize_config_dir(str(conf_dir()), version_base="1.3"):
            yield
    finally:
        GlobalHydra.instance().hydra = running


def find_problems(
    config_name: str,
    overrides: Sequence[str],
    check: Check | None,
    multirun: bool = True,
    config_dir: Path | None = None,
) -> list[str]:
    """Every problem of a command line (or sweep), one line each; empty if there is none.

    Of a sweep, each swept value is tried beside the first values of the others.

    Args:
        config_name: file in ``conf/``, without its suffix.
        overrides: as on the command line.
        check: what a composed configuration must satisfy; None: nothing, not even that all values are given.
        multirun: whether several values are allowed.
        config_dir: searched for groups beside ``conf/``.
    """
    register_schemas()
    with _composing():
        loader = GlobalHydra.instance().config_loader()
        composed = _compositions(config_name)
        problems, jobs = [], [[f"{SEARCHPATH}=[file://{config_dir.resolve()}]"] if config_dir else []]
        swept = _swept_by_file(composed, [*jobs[0], *overrides]) if multirun else []
        for override in [*overrides, *swept]:
            if override.startswith("~") and not loader.get_group_options(_key(override)):
                problems.append(f"{override}: a key cannot be removed; give it a value instead")
                continue
            try:
                (parsed,) = OverridesParser.create(loader).parse_overrides([override])
                choices = _choices(parsed)
            except (HydraException, ValueError):  # ValueError: thousands of digits
                choices = []
            if not choices or not _key(override):
                problems.append(
                    f"{override}: cannot be read; write key=value, and quote a value that holds spaces, commas, "
                    f"brackets or '=' twice: 'key=\"...\"'"
                )
                continue
            if len(choices) > 1 and not multirun:
                problems.append(f"{override}: gives several values; add -m to run them one after another")
            first = jobs[0]
            jobs = [[*job, choices[0]] for job in jobs] + [[*first, choice] for choice in choices[1:]]
        if config_dir is not None or any(_key(override) == SEARCHPATH for override in overrides):
            problems += _code_of_files(composed, jobs[0])
        unread = tuple(f"{problem.partition('=')[0]}:" for problem in problems)
        for job in jobs:
            problems += [
                p for p in _problems_of_job(config_name, composed, job, check) if not p.startswith(unread)
            ]
        return list(dict.fromkeys(problems))


def _compositions(config_name: str) -> Compositions:
    """Compositions of a file in ``conf/``, each made once: it takes tenths of a second."""

    @cache
    def composed(overrides: tuple[str, ...]) -> DictConfig:
        return compose(config_name, list(overrides), return_hydra_config=True)

    return composed


def _code_of_files(composed: Compositions, overrides: list[str]) -> list[str]:
    """What files from elsewhere would run; nothing if they do not compose, which is reported for itself."""
    try:
        return code_named(composed(tuple(overrides)).hydra)
    except COMPOSITION_ERRORS:
        return []


def _swept_by_file(composed: Compositions, overrides: Sequence[str]) -> list[str]:
    """The sweeps of ``hydra.sweeper.params``, as an experiment may have, that the command line does not replace."""
    parser = OverridesParser.create()
    try:
        first = tuple(_choices(parser.parse_override(override))[0] for override in overrides)
        params = composed(first).hydra.sweeper.get("params") or {}
    except (*COMPOSITION_ERRORS, IndexError):
        return []
    given = {_key(override) for override in overrides}
    return [f"{key}={value}" for key, value in params.items() if key not in given]


def _choices(override: Override) -> list[str]:
    """The single values of a sweep override, or the override itself; of an interval its ends."""
    if not override.is_sweep_override():
        return [str(override.input_line)]
    if override.is_interval_sweep():
        ends: Any = override.value()
        return [f"{override.get_key_element()}={end}" for end in (ends.start, ends.end)]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]


def _problems_of_job(
    config_name: str, composed: Compositions, overrides: list[str], check: Check | None
) -> list[str]:
    try:
        cfg = deepcopy(composed(tuple(overrides)))
    except COMPOSITION_ERRORS as error:
        return _problems_one_by_one(config_name, overrides) or [one_line(error)]
    nodes, given = _nodes(cfg), set(map(_key, overrides))
    values = [*_of_given(_unresolved(nodes, given), given), *_of_given(_too_large(nodes), given)]
    if check is None:
        return values
    with open_dict(cfg):
        del cfg["hydra"]
    nodes = _nodes(cfg)
    schema = OmegaConf.get_type(cfg)
    assert is_dataclass(schema)
    known = [field.name for field in fields(schema)]
    problems = [f"{key}: {unknown_key(key, known)}" for key in map(str, cfg) if key not in known]
    problems += [f"{key}: no value given; add {key}=..." for key, node in nodes.items() if node._is_missing()]
    if problems or values:
        return [*problems, *values]
    try:
        return check(cfg)
    except InterpolationKeyError as error:
        return [f"{error.full_key}={nodes[str(error.full_key)]._value()}: {NO_SUCH_KEY}"]


def _of_given(problems: Mapping[str, str], given: Container[str]) -> list[str]:
    """Of problems by key those of the keys that were given: other keys refer to these."""
    return [problem for key, problem in problems.items() if key in given] or list(problems.values())


def _unresolved(nodes: Mapping[str, Node], given: Container[str]) -> dict[str, str]:
    """Values that refer to something that is not there, by key.

    A key that does not exist counts where the reference was given: that of a group may refer to a checkpoint's.
    """
    problems: dict[str, str] = {}
    for key, node in nodes.items():
        # Hydra's own references can be followed only while a job runs.
        if not node._is_interpolation() or "${hydra:" in str(node._value()):
            continue
        try:
            node._dereference_node()
        except InterpolationToMissingValueError:
            continue
        except InterpolationKeyError:
            if key in given:
                problems[key] = f"{key}={node._value()}: {NO_SUCH_KEY}"
        except OmegaConfBaseException as error:
            reason = str(error).splitlines()[0].rpartition("interpolation: ")[2].strip('"')
            problems[key] = f"{key}={node._value()}: cannot be resolved ({reason}); give a value"
    return problems


def _too_large(nodes: Mapping[str, Node]) -> dict[str, str]:
    """Whole numbers beyond what anything here can count, by key."""
    return {
        key: f"{key}={node._value()}: must be at most {LARGEST}"
        for key, node in nodes.items()
        if isinstance(node._value(), int) and node._value() > LARGEST
    }


def _problems_one_by_one(config_name: str, overrides: list[str]) -> list[str]:
    """Try the overrides of groups first, then each value on top of the groups that compose."""
    problems: list[str] = []
    loader = GlobalHydra.instance().config_loader()
    good = [override for override in overrides if _key(override) == SEARCHPATH]
    overrides = [override for override in overrides if override not in good]
    for override in (o for o in overrides if loader.get_group_options(_key(o))):
        try:
            compose(config_name, [*good, override])
            good.append(override)
        except COMPOSITION_ERRORS as error:
            problems.append(_problem_of_group(config_name, override, good, error))
    known = _nodes(compose(config_name, good, return_hydra_config=True))
    for override in (o for o in overrides if not loader.get_group_options(_key(o))):
        try:
            compose(config_name, [*good, override])
        except COMPOSITION_ERRORS as error:
            key, _, value = override.partition("=")
            node = known.get(_key(override))
            group = _key(override).partition(".")[0]
            if node is None and group in known and known[group]._is_none():
                options = ", ".join(_options(group))
                problems.append(
                    f"{override}: there is no {group} to change; say {group}=..., one of {options}"
                )
            elif node is None:
                problems.append(f"{_key(override)}: {unknown_key(_key(override), known)}")
            elif key.startswith("+") and not key.startswith("++"):
                problems.append(f"{override}: the key exists already; write {override[1:]}")
            elif expected := expected_value(node, key.lstrip("+")):
                problems.append(f"{key}={value}: must be {expected}")
            else:
                problems.append(f"{override}: {one_line(error)}")
    return problems


def _problem_of_group(config_name: str, override: str, good: list[str], error: Exception) -> str:
    key, _, value = override.partition("=")
    options = _options(_key(override))
    of_ones_own = any(_key(override) == SEARCHPATH for override in good) and not (
        isinstance(error, MissingConfigException) and error.missing_cfg_file == f"{_key(override)}/{value}"
    )
    if value not in options and not of_ones_own:
        return f"{key}={value}: unknown choice; {nearest(str(value), options)}"
    choices = compose(config_name, good, return_hydra_config=True).hydra.runtime.choices
    if _key(override) in choices:
        return f"{override}: {one_line(error)}"
    owner, _, part = _key(override).rpartition("/")
    if owner in choices:
        return f"{override}: {owner}={choices[owner]} has no {part}; leave it out or choose another {owner}"
    groups = ", ".join(sorted(group for group in choices if "/" not in group))
    return f"{override}: {config_name} has no group {key}; its groups are {groups}"


def _options(group: str) -> list[str]:
    """What can be chosen of a group."""
    options = GlobalHydra.instance().config_loader().get_group_options(group)
    return [option for option in options if not option.startswith("base_")]


def _key(override: str) -> str:
    return override.partition("=")[0].lstrip("+~").partition("@")[0]


def _nodes(cfg: DictConfig, prefix: str = "") -> dict[str, Node]:
    """All nodes by dotted key; values that refer to others unresolved."""
    nodes: dict[str, Node] = {}
    for name in map(str, cfg.keys()):
        node = cfg._get_node(name)
        assert isinstance(node, Node)
        nodes[f"{prefix}{name}"] = node
        target = node._maybe_dereference_node()
        if isinstance(target, DictConfig) and not target._is_missing():
            nodes |= _nodes(target, f"{prefix}{name}.")
    return nodes
