"""What a page needs of ``metrics.json`` besides what tells evaluations apart."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stereo_occ.errors import UserError
from stereo_occ.evaluation_form import Form, wrong_value

SHOWN: Form = {
    "objects": int,
    "threshold": float,
    "failures": dict,
    "reliability": dict,
    "metrics.test/iou": int | float,
    "meshes.views": int,
    "meshes.resolution": int,
    "meshes.points": int,
    "data": str,
    "torch": str,
    "cpu": str,
    "commit": str | None,
    "trained.history": list | None,
}

#: Of a validation in the history; a value that was not finite is null.
VALIDATION: Form = {
    "step": int,
    "val/iou": int | float | None,
    "val/iou_bbox": int | float | None,
    "val/loss": int | float | None,
}

#: By which a mean of probabilities may lie above 1.
ROUNDING = 1e-3


def check_shown(facts: Mapping[str, Any], categories: Iterable[str], path: Path) -> None:
    """Refuse what no page can show.

    Args:
        facts: of an evaluation, as read.
        categories: of its objects.
        path: of the file.

    Raises:
        UserError: something is missing or of the wrong type.
    """
    wrong = wrong_value(facts, SHOWN)
    wrong = wrong or _wrong_validation((facts.get("trained") or {}).get("history") or ())
    wrong = wrong or _wrong_bins(facts["reliability"], categories)
    if wrong:
        raise UserError(f"{path}: is damaged, {wrong}; evaluate the checkpoint again")


def _wrong_validation(history: Sequence[Any]) -> str | None:
    for validation in history:
        if not isinstance(validation, Mapping):
            return f"trained.history has {validation!r:.60}"
        if wrong := wrong_value(validation, VALIDATION):
            return f"trained.history: {wrong}"
    return None


def _wrong_bins(reliability: Mapping[str, Any], categories: Iterable[str]) -> str | None:
    for category in categories:
        bins = reliability.get(category)
        if not _are_bins(bins):
            return f"reliability of {category} is {bins!r:.60}"
    return None


def _are_bins(rows: Any) -> bool:
    """Whether it is points, mean probability and share occupied of some bins of probability."""
    try:
        rows_K3 = np.asarray(rows, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        return False
    if rows_K3.ndim != 2 or rows_K3.shape[1] != 3 or not np.isfinite(rows_K3).all():
        return False
    points_K, shares_K2 = rows_K3[:, 0], rows_K3[:, 1:]
    return bool((points_K > 0).all() and (shares_K2 >= 0).all() and (shares_K2 <= 1 + ROUNDING).all())
