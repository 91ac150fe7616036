"""Encoders and cost volumes from outside this package: ``docs/extend.md`` has an example.

A module of one's own names its parts with :func:`encoder` and :func:`cost_volume`. Programs import the modules that
the environment variable :data:`VARIABLE` lists. A configuration or checkpoint only names parts: none of them can make
a program import anything.
"""

import os
from collections.abc import Callable, MutableMapping
from dataclasses import field, make_dataclass
from functools import partial
from importlib import import_module
from inspect import Parameter, signature
from traceback import extract_tb
from typing import Any, TypeVar, get_type_hints

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from stereo_occ.errors import UserError
from stereo_occ.models.build import COST_VOLUMES, ENCODERS
from stereo_occ.models.config import CostVolumeConfig, EncoderConfig
from stereo_occ.models.cost_volumes import CostVolume
from stereo_occ.models.encoders import ImageEncoder

VARIABLE = "STEREO_OCC_PLUGINS"

#: What parts are given if they take it; their other keyword-only arguments are settings.
GIVEN = {"encoder": {"stride", "load_weights"}, "cost_volume": {"disparities"}}

E = TypeVar("E", bound=type[ImageEncoder])
V = TypeVar("V", bound=type[CostVolume])


def encoder(name: str) -> Callable[[E], E]:
    """Decorate an image encoder to make it ``model/encoder=<name>``.

    Its keyword-only arguments are its settings, with their defaults, but for two that it is given if it takes them:
    ``stride``, the model's ``feature_stride`` or None, and ``load_weights``, False if a checkpoint follows.

    Raises:
        UserError: another encoder has the name, or a setting is of a type that a configuration cannot hold.
    """

    def decorate(part: E) -> E:
        _register("encoder", name, part, ENCODERS, EncoderConfig)
        return part

    return decorate


def cost_volume(name: str) -> Callable[[V], V]:
    """Decorate a cost volume to make it ``model/cost_volume=<name>``.

    It is constructed with the number of feature channels. Its keyword-only arguments are its settings, but for
    ``disparities``: those that the rig allows, in feature cells.

    Raises:
        UserError: as for :func:`encoder`.
    """

    def decorate(part: V) -> V:
        _register("cost_volume", name, part, COST_VOLUMES, CostVolumeConfig)
        return part

    return decorate


def load_extensions() -> None:
    """Import the modules that :data:`VARIABLE` names, separated by commas.

    Raises:
        UserError: one of them cannot be found, or fails when it is imported.
    """
    for name in filter(None, map(str.strip, os.environ.get(VARIABLE, "").split(","))):
        try:
            import_module(name)
        except UserError:
            raise
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and error.name == name:
                raise UserError(
                    f"{VARIABLE}={name}: no such module; name one in the working directory or of an installed package"
                ) from error
            raise UserError(
                f"{VARIABLE}={name}: {_place(error)}: {type(error).__name__}: {' '.join(str(error).split())}; "
                f"correct it, or leave the module out of {VARIABLE}"
            ) from error


def _place(error: Exception) -> str:
    """The file and line that an import has failed at: where a text is no Python, else the last that ran."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}"
    last = extract_tb(error.__traceback__)[-1]
    return f"{last.filename}, line {last.lineno}"


def _register(group: str, name: str, part: Any, table: MutableMapping[str, Any], base: type) -> None:
    known = table.setdefault(name, part)
    if (known.__module__, known.__qualname__) != (part.__module__, part.__qualname__):
        raise UserError(f"model/{group}={name}: is {known.__module__}.{known.__qualname__} already")
    table[name] = part
    types = get_type_hints(part.__init__)
    settings = [
        (p.name, types.get(p.name, Any), field(default_factory=partial(_default, p.default)))
        for p in signature(part).parameters.values()
        if p.kind is Parameter.KEYWORD_ONLY and p.name not in GIVEN[group]
    ]
    schema = make_dataclass(f"{part.__name__}Config", [("name", str, name), *settings], bases=(base,))
    try:
        OmegaConf.structured(schema)
    except OmegaConfBaseException as error:
        raise UserError(
            f"model/{group}={name}: {str(error).splitlines()[0]}; settings are int, float, bool, str or lists of these"
        ) from error
    ConfigStore.instance().store(group=f"model/{group}", name=name, node=schema)


def _default(value: Any) -> Any:
    return MISSING if value is Parameter.empty else value
