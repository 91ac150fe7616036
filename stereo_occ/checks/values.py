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
    for key in keys:
        if value_of(cfg, key) < minimum:
            yield f"{key}={value_of(cfg, key)}: must be at least {minimum}"


def at_most(maximum: int, cfg: DictConfig, *keys: str) -> Iterator[str]:
    for key in keys:
        if value_of(cfg, key) > maximum:
            yield f"{key}={value_of(cfg, key)}: must be at most {maximum}"


def known(key: str, value: str, known: Sequence[str] | dict[str, Any]) -> Iterator[str]:
    if value not in known:
        yield f"{key}={value}: unknown; {nearest(value, known)}"


def refusal(function: Any, *arguments: Any) -> Iterator[str]:
    try:
        function(*arguments)
    except UserError as error:
        yield str(error)


def value_of(cfg: DictConfig, key: str) -> Any:
    return OmegaConf.select(cfg, key)
