"""What ``metrics.json`` of an evaluation must hold for others to read it."""

from collections.abc import Mapping
from math import isfinite
from types import UnionType
from typing import Any

#: Types by dotted key.
Form = Mapping[str, type | UnionType]

#: What tells evaluations and models apart, as ``compare`` and ``report`` do.
IDENTITY: Form = {
    "subset": str,
    "protocol": int,
    "views": int,
    "points": int,
    "meshes": dict,
    "metrics": dict,
    "split": dict | None,
    "parameters": int | None,
    "step": int | None,
    "predictor": dict | None,
    "predictor.baseline": dict | None,
    "predictor.baseline.name": str,
    "control": dict | None,
    "control.name": str,
    "trained": dict | None,
    "trained.config": dict,
    "trained.config.model": dict,
    "trained.config.model.name": str,
    "trained.config.control.name": str,
}


def wrong_value(facts: Mapping[str, Any], form: Form) -> str | None:
    """Key and value of the first that is not as in the form; None if there is none.

    What is inside of something counts only where that is there. A truth value is no number, nor is NaN or infinity.
    """
    for key, kind in form.items():
        *parents, name = key.split(".")
        inside: Any = facts
        for parent in parents:
            inside = inside.get(parent) if isinstance(inside, Mapping) else None
        if isinstance(inside, Mapping) and not _is(inside.get(name), kind):
            return f"{key} is {inside.get(name)!r:.60}"
    return None


def _is(value: Any, kind: type | UnionType) -> bool:
    if isinstance(value, float):
        return isinstance(value, kind) and isfinite(value)
    return isinstance(value, kind) and not isinstance(value, bool)
