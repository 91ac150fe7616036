"""Which objects are for training, validation and test."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from stereo_occ.errors import UserError
from stereo_occ.shapes.layouts import SUBSETS as SUBSETS


def split_objects(
    objects: Sequence[tuple[str, str]],
    fractions: Sequence[float],
    seed: int,
    given: Mapping[tuple[str, str], str] | None = None,
) -> dict[str, list[tuple[str, str]]]:
    """Divide ``(category, object_id)`` pairs within each category, so that no object is in two subsets.

    A subset with a fraction above 0 gets at least one object of each category. The division of one category depends
    only on its own objects and the seed.

    Args:
        given: subset by object, for every object of the categories that come divided; these are left as they are.

    Raises:
        UserError: a category has fewer objects than subsets to fill.
    """
    by_category = defaultdict(list)
    for category, object_id in objects:
        by_category[category].append(object_id)
    subsets: dict[str, list[tuple[str, str]]] = {name: [] for name in SUBSETS}
    for category, ids in sorted(by_category.items()):
        if given and (category, ids[0]) in given:
            for object_id in sorted(ids):
                subsets[given[category, object_id]].append((category, object_id))
            continue
        order = np.random.default_rng([seed, len(ids)]).permutation(len(ids))
        bounds = np.cumsum([0, *subset_sizes(len(ids), fractions, category)])
        for name, low, high in zip(SUBSETS, bounds[:-1], bounds[1:], strict=True):
            subsets[name] += [(category, sorted(ids)[i]) for i in sorted(order[low:high])]
    return subsets


def split_views(views: int, fractions: Sequence[float], subset: str) -> range:
    """The views of every object that belong to ``subset``: the paper's wording, objects are on all sides."""
    bounds = np.cumsum([0, *subset_sizes(views, fractions, "views")])
    index = SUBSETS.index(subset)
    return range(int(bounds[index]), int(bounds[index + 1]))


def subset_sizes(count: int, fractions: Sequence[float], what: str) -> list[int]:
    """Sizes of train, val and test that add up to ``count``; see :func:`split_objects`.

    The largest subset takes what rounding leaves over.
    """
    needed = sum(fraction > 0 for fraction in fractions)
    if count < needed:
        raise UserError(
            f"{what}: {count} are too few to divide into train, val and test; have at least {needed}"
        )
    sizes = [max(1, round(count * fraction)) if fraction > 0 else 0 for fraction in fractions]
    sizes[int(np.argmax(fractions))] += count - sum(sizes)
    return sizes
