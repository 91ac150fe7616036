"""Which models and object-views the page shows: chosen by rule."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_occ.advice import nearest
from stereo_occ.errors import UserError
from stereo_occ.evaluation_rows import Key
from stereo_occ.report.models import Model, in_order

#: What models and views are ranked by.
METRIC = "iou"

#: Of a category: how many views of the failure gallery rank lowest, and how many lose most.
LOWEST, LOST = 2, 1


@dataclass(frozen=True)
class Choice:
    """One object-view and why it is shown."""

    key: Key
    reason: str


def choose_models(
    models: Sequence[Model], focus: str | None, against: str | None
) -> tuple[Model, Model | None]:
    """The model in focus and the one it is set against, the latter None if there is but one.

    Without a label, the focus is the network with the highest IoU among those that use the pair (among all if none
    does); against it stands the one with the highest IoU among networks that see one image (else among the others).

    Raises:
        UserError: no model has that label.
    """
    chosen = _labelled(models, "focus", focus) or _best(
        [model for model in models if model.is_network and model.uses_pair], models
    )
    others = [model for model in models if model is not chosen]
    opponent = _labelled(models, "against", against)
    if opponent is chosen:
        raise UserError(f"against={against}: is the model in focus; give another one")
    if opponent is None and others:
        opponent = _best([model for model in others if model.is_network and not model.uses_pair], others)
    return chosen, opponent


def best_median_worst(keys: Sequence[Key], iou_V: NDArray[np.float64]) -> dict[str, list[Choice]]:
    """Of each category the views with the highest, the middle (lower of two) and the lowest IoU; equals by name."""
    shown: dict[str, list[Choice]] = {}
    for category, ranked in _ranked(keys, iou_V).items():
        places = {"worst": 0, "median": (len(ranked) - 1) // 2, "best": len(ranked) - 1}
        order = ("best", "median", "worst")
        taken: dict[Key, str] = {}
        for name in order:
            taken.setdefault(ranked[places[name]], name)
        shown[category] = [Choice(key, name) for key, name in taken.items()]
    return shown


def failures(
    keys: Sequence[Key],
    iou_V: NDArray[np.float64],
    against_V: NDArray[np.float64] | None,
    shown: Sequence[Key],
) -> dict[str, list[Choice]]:
    """Of each category the :data:`LOWEST` views with the lowest IoU, then the :data:`LOST` that lose most.

    Views in ``shown``, and those that win against the other model, are passed over.
    """
    chosen: dict[str, list[Choice]] = {}
    iou = dict(zip(keys, iou_V.tolist(), strict=True))
    lead = {} if against_V is None else dict(zip(keys, (iou_V - against_V).tolist(), strict=True))
    for category, ranked in _ranked(keys, iou_V).items():
        left = [key for key in ranked if key not in shown]
        lowest = left[:LOWEST]
        losing = sorted((key for key in left[LOWEST:] if lead and lead[key] < 0), key=lambda key: lead[key])
        chosen[category] = [
            *(Choice(key, f"{_ordinal(ranked.index(key) + 1)} lowest, {iou[key]:.2f}") for key in lowest),
            *(Choice(key, f"loses most, {lead[key]:+.2f}") for key in losing[:LOST]),
        ]
    return {category: choices for category, choices in chosen.items() if choices}


def _ranked(keys: Sequence[Key], iou_V: NDArray[np.float64]) -> dict[str, list[Key]]:
    """Keys of each category from the lowest IoU to the highest."""
    order = [key for _, key in sorted(zip(iou_V.tolist(), keys, strict=True))]
    return {
        category: [key for key in order if key[0] == category]
        for category in in_order(key[0] for key in keys)
    }


def _ordinal(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th") if number > 1 else "the"


def _labelled(models: Sequence[Model], key: str, label: str | None) -> Model | None:
    if label is None:
        return None
    for model in models:
        if model.label == label:
            return model
    raise UserError(f"{key}={label}: no model has this label; {nearest(label, [m.label for m in models])}")


def _best(preferred: Sequence[Model], otherwise: Sequence[Model]) -> Model:
    return max(preferred or otherwise, key=lambda model: model.mean(METRIC))
