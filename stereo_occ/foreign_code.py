"""Code that a configuration from elsewhere would have Hydra run."""

from collections.abc import Iterator
from typing import Any

from omegaconf import DictConfig, OmegaConf

#: What may be named: Hydra's own parts, its plugins as installed, what logs to a stream or a file.
TRUSTED = (
    "hydra._internal.core_plugins.",
    "hydra_plugins.",
    "logging.StreamHandler",
    "logging.FileHandler",
    "logging.NullHandler",
    "logging.Formatter",
    "colorlog.",
)

#: Keys whose values Hydra or Python's logging calls.
CALLED = ("_target_", "()", "class")


def code_named(hydra_cfg: DictConfig) -> list[str]:
    """One line for each thing in the node ``hydra`` that would run code from outside of Hydra and its plugins."""
    values = OmegaConf.to_container(hydra_cfg, resolve=False)
    assert isinstance(values, dict)
    problems = [
        f"{key}={value}: would run code that is none of Hydra's; remove it"
        for key, value in _leaves(values, "hydra")
        if key.rpartition(".")[2] in CALLED and not str(value).startswith(TRUSTED)
    ]
    if variables := hydra_cfg.job.env_set:
        problems.append(
            f"hydra.job.env_set={','.join(map(str, variables))}: variables of the environment can make a program run "
            f"code; set them in the shell"
        )
    return problems


def _leaves(value: Any, key: str) -> Iterator[tuple[str, Any]]:
    """The values of nested dictionaries and lists with their dotted keys."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from _leaves(part, f"{key}.{name}")
    elif isinstance(value, list):
        for part in value:
            yield from _leaves(part, key)
    else:
        yield key, value
