"""What single values must satisfy."""

from collections.abc import Iterator, Sequence
from typing import Any

from omegaconf import DictConfig, OmegaConf

from stereo_occ.advice import nearest
from stereo_occ.errors import UserError

#: Of meshes per side of the cube and of samples, which have to be held in memory.
MOST_CELLS = 512
MOST_POINTS = 10_000_000


def at_least(minimum: int, cfg: DictConfig, *keys: str) -> Iterator[str]:
    """The keys whose values are below ``minimum``."""
    for key in keys:
        if value_of(cfg, key) < minimum:
            yield f"{key}={value_of(cfg, key)}: must be at least {minimum}"


def at_most(maximum: int, cfg: DictConfig, *keys: str) -> Iterator[str]:
    """The keys whose values are above ``maximum``."""
    for key in keys:
        if value_of(cfg, key) > maximum:
            yield f"{key}={value_of(cfg, key)}: must be at most {maximum}"


def known(key: str, value: str, choices: Sequence[str] | dict[str, Any]) -> Iterator[str]:
    """A value that is none of the choices."""
    if value not in choices:
        yield f"{key}={value}: unknown; {nearest(value, choices)}"


def refusal(function: Any, *arguments: Any) -> Iterator[str]:
    """What a function has against its arguments."""
    try:
        function(*arguments)
    except UserError as error:
        yield str(error)


def value_of(cfg: DictConfig, key: str) -> Any:
    """Of a dotted key."""
    return OmegaConf.select(cfg, key)
