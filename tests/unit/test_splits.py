from collections import Counter
from itertools import chain

import pytest
from samples import PAPER_COUNTS

from stereo_occ.data.splits import SUBSETS, split_objects, split_views, subset_sizes
from stereo_occ.errors import UserError

FRACTIONS = (0.8, 0.1, 0.1)


def objects(counts):
    return [(name, f"{name}_{i:04d}") for name, count in counts.items() for i in range(count)]


def test_every_object_is_in_exactly_one_subset():
    every = objects(PAPER_COUNTS)
    split = split_objects(every, FRACTIONS, seed=0)
    assert tuple(split) == SUBSETS
    assert sorted(chain.from_iterable(split.values())) == sorted(every)


def test_the_papers_shares_in_every_category():
    split = split_objects(objects(PAPER_COUNTS), FRACTIONS, seed=0)
    sizes = {name: Counter(category for category, _ in split[name]) for name in SUBSETS}
    assert sizes == {
        "train": {"mug": 92, "bowl": 140, "bottle": 282},
        "val": {"mug": 11, "bowl": 17, "bottle": 35},
        "test": {"mug": 11, "bowl": 17, "bottle": 35},
    }


def test_the_order_of_the_objects_does_not_matter():
    every = objects({"mug": 30, "bowl": 20})
    assert split_objects(every[::-1], FRACTIONS, seed=0) == split_objects(every, FRACTIONS, seed=0)


def test_one_category_is_divided_the_same_whatever_else_there_is():
    together = split_objects(objects(PAPER_COUNTS), FRACTIONS, seed=0)
    alone = split_objects(objects({"mug": PAPER_COUNTS["mug"]}), FRACTIONS, seed=0)
    for name in SUBSETS:
        assert alone[name] == [key for key in together[name] if key[0] == "mug"]


def test_the_division_is_fixed_by_the_seed():
    """These objects are held out in every run with seed 0; a change here makes old test results void."""
    split = split_objects(objects({"mug": 20}), FRACTIONS, seed=0)
    assert split["val"] == [("mug", "mug_0002"), ("mug", "mug_0012")]
    assert split["test"] == [("mug", "mug_0004"), ("mug", "mug_0014")]
    assert split_objects(objects({"mug": 20}), FRACTIONS, seed=1) != split


def test_held_out_objects_are_drawn_from_all_over_the_list():
    split = split_objects(objects({"bottle": 1000}), FRACTIONS, seed=0)
    numbers = [int(object_id[-4:]) for _, object_id in split["test"]]
    assert sum(numbers) / len(numbers) == pytest.approx(499.5, abs=4 * 289 / 10)
    assert numbers == sorted(numbers)


def test_a_small_category_still_has_one_object_of_each():
    split = split_objects(objects({"mug": 3}), FRACTIONS, seed=0)
    assert [len(split[name]) for name in SUBSETS] == [1, 1, 1]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_objects(count):
    with pytest.raises(UserError, match=rf"mug: {count} are too few.*at least 3"):
        subset_sizes(count, FRACTIONS, "mug")
    if count:
        with pytest.raises(UserError, match="mug"):
            split_objects(objects({"mug": count, "bowl": 10}), FRACTIONS, seed=0)


@pytest.mark.parametrize(
    ("count", "fractions", "sizes"),
    [
        (10, (1.0, 0.0, 0.0), [10, 0, 0]),
        (10, (0.0, 0.0, 1.0), [0, 0, 10]),
        (5, (0.0, 0.5, 0.5), [0, 3, 2]),
        (1, (0.0, 0.0, 1.0), [0, 0, 1]),
        (10, (0.9, 0.0, 0.1), [9, 0, 1]),
        (7, (0.2, 0.4, 0.4), [1, 3, 3]),
    ],
)
def test_sizes_add_up_and_a_share_of_zero_is_empty(count, fractions, sizes):
    assert subset_sizes(count, fractions, "mug") == sizes


@pytest.mark.parametrize(
    "fractions", [(0.8, 0.1, 0.1), (0.0, 0.5, 0.5), (0.02, 0.49, 0.49), (0.1, 0.9, 0.0), (0.34, 0.33, 0.33)]
)
def test_whatever_the_shares_only_an_unwanted_subset_is_empty(fractions):
    wanted = [fraction > 0 for fraction in fractions]
    for count in range(sum(wanted), 60):
        sizes = subset_sizes(count, fractions, "mug")
        assert sum(sizes) == count
        assert [size > 0 for size in sizes] == wanted
        assert all(abs(size - count * share) <= 2 for size, share in zip(sizes, fractions, strict=True))
    with pytest.raises(UserError, match="too few"):
        subset_sizes(sum(wanted) - 1, fractions, "mug")


def test_views_are_divided_without_overlap():
    subsets = [split_views(1000, FRACTIONS, name) for name in SUBSETS]
    assert [len(views) for views in subsets] == [800, 100, 100]
    assert list(chain.from_iterable(subsets)) == list(range(1000))


def test_too_few_views():
    with pytest.raises(UserError, match="views: 2 are too few"):
        split_views(2, FRACTIONS, "train")
