"""From Hydra's sweeps to Optuna's distributions."""

from collections.abc import Sequence
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import IntervalSweep, Override, RangeSweep
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)

from stereo_occ.errors import UserError


def search_space(overrides: Sequence[str]) -> tuple[dict[str, BaseDistribution], list[str]]:
    """What is searched, by key, and the overrides that are the same for every trial; of a key the last one counts.

    ``interval(a,b)`` is a range of numbers, on a logarithmic scale with ``tag(log,interval(a,b))`` and whole with
    ``int(interval(a,b))``; ``range(a,b,step)`` is in steps, without ``b`` itself; other sweeps are choices.

    Raises:
        UserError: nothing is searched, or a range is empty.
    """
    space: dict[str, BaseDistribution] = {}
    fixed: dict[str, str] = {}
    for override in OverridesParser.create().parse_overrides(list(overrides)):
        key = override.get_key_element()
        space.pop(key, None)
        fixed.pop(key, None)
        if override.is_sweep_override():
            space[key] = _distribution(override)
        else:
            fixed[key] = f"{key}={override.get_value_element_as_str()}"
    if not space:
        raise UserError(
            "hydra.sweeper.params: names nothing to search; add for example 'optimizer.lr=tag(log,interval(1e-4,1e-2))'"
        )
    return space, list(fixed.values())


def _distribution(override: Override) -> BaseDistribution:
    value: Any = override.value()
    try:
        if isinstance(value, IntervalSweep):
            return _numbers(value.start, value.end, log="log" in value.tags)
        if isinstance(value, RangeSweep) and not value.shuffle:
            values = list(value.range())
            return _numbers(values[0], values[-1], step=value.step)
        return CategoricalDistribution(list(override.sweep_string_iterator()))
    except (ValueError, IndexError) as error:
        raise UserError(f"{override.input_line}: no range to search ({error})") from error


def _numbers(low: Any, high: Any, **settings: Any) -> BaseDistribution:
    whole = isinstance(low, int) and isinstance(high, int)
    return IntDistribution(low, high, **settings) if whole else FloatDistribution(low, high, **settings)
