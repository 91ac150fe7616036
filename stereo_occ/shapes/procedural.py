"""Procedural household objects: any number of them from a seed, without a download."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from stereo_occ.errors import UserError
from stereo_occ.shapes.bottle import bottle
from stereo_occ.shapes.bowl import bowl
from stereo_occ.shapes.mug import mug
from stereo_occ.shapes.shape import CATEGORIES, Shape

_MAKERS: dict[str, Callable[[Generator, str], Shape]] = {"mug": mug, "bowl": bowl, "bottle": bottle}


def procedural_shape(category: str, seed: int, index: int) -> Shape:
    """Object number ``index`` of an endless series, the same in every run and process.

    +Y is up, a handle points to +X.

    Args:
        category: "mug", "bowl" or "bottle".
        seed: of the series.
        index: in the series, from 0; objects with different indices are independent.

    Raises:
        UserError: the category is unknown.
    """
    if category not in _MAKERS:
        raise UserError(
            f"category '{category}' has no procedural objects: choose among {', '.join(CATEGORIES)}"
        )
    rng = np.random.default_rng([seed, CATEGORIES.index(category), index])
    return _MAKERS[category](rng, f"{category}_{index:04d}").normalized()
