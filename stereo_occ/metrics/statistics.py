"""Paired bootstrap of the difference of two results, clustered by object.

The views of one object are not independent, so whole objects are drawn, within each category (a stratified cluster
bootstrap; Efron and Tibshirani 1993). Both results are looked at on the same drawn objects, so what makes an object
hard cancels. Where a result has several training seeds, seeds are drawn too, for each result on its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Difference:
    """Means of A and B, and A - B with its interval; ``low`` and ``high`` are None where there is none.

    Attributes:
        objects: how many the means are over.
    """

    a: float
    b: float
    difference: float
    low: float | None
    high: float | None
    objects: int

    @property
    def clear(self) -> bool:
        """Whether the interval leaves out 0."""
        return self.low is not None and self.high is not None and (self.low > 0 or self.high < 0)


def paired_bootstrap(
    a_SV: NDArray[np.float64],
    b_TV: NDArray[np.float64],
    categories_V: Sequence[str],
    objects_V: Sequence[str],
    draws: int = 10_000,
    level: float = 0.95,
    seed: int = 0,
) -> dict[str, Difference]:
    """Percentile intervals of A - B per category, and of ``macro``, the mean of category means.

    Args:
        a_SV, b_TV: a metric of the same V object-views, one row per training seed.
        categories_V, objects_V: category of each object-view, and its object's name, unique within the category.

    Returns:
        By category, then ``macro``. A category with one object has no interval, and nor has then ``macro``.
    """
    rng = np.random.default_rng(seed)
    category_V, object_V = np.asarray(categories_V), np.asarray(objects_V)
    seeds_a_DS, seeds_b_DT = (_counts(rng, draws, len(side)) / len(side) for side in (a_SV, b_TV))
    results: dict[str, Difference] = {}
    drawn: list[NDArray[np.float64]] = []
    for category in sorted(set(categories_V)):
        mine_V = category_V == category
        _, object_M = np.unique(object_V[mine_V], return_inverse=True)
        views_O = np.bincount(object_M).astype(np.float64)
        sums_a_SO, sums_b_TO = (_sums(side[:, mine_V], object_M) for side in (a_SV, b_TV))
        a, b = (float(sums.mean(0).sum() / views_O.sum()) for sums in (sums_a_SO, sums_b_TO))
        objects_DO = _counts(rng, draws, len(views_O))
        difference_DO = seeds_a_DS @ sums_a_SO - seeds_b_DT @ sums_b_TO
        difference_D = (objects_DO * difference_DO).sum(1) / (objects_DO @ views_O)
        drawn.append(difference_D)
        low, high = _interval(difference_D, level) if len(views_O) > 1 else (None, None)
        results[category] = Difference(a, b, a - b, low, high, len(views_O))
    a, b = (float(np.mean([getattr(r, side) for r in results.values()])) for side in ("a", "b"))
    known = all(r.low is not None for r in results.values())
    low, high = _interval(np.mean(drawn, axis=0), level) if known else (None, None)
    objects = sum(r.objects for r in results.values())
    return results | {"macro": Difference(a, b, a - b, low, high, objects)}


def _counts(rng: np.random.Generator, draws: int, items: int) -> NDArray[np.float64]:
    """How often each item is drawn ``(draws, items)``, with replacement, as many as there are."""
    return rng.multinomial(items, np.full(items, 1 / items), draws).astype(np.float64)


def _sums(values_SM: NDArray[np.float64], object_M: NDArray[np.intp]) -> NDArray[np.float64]:
    """Sums over the views of each object ``(S, O)``."""
    return np.stack([np.bincount(object_M, weights=row_M) for row_M in values_SM])


def _interval(values_D: NDArray[np.float64], level: float) -> tuple[float, float]:
    low, high = np.quantile(values_D, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
