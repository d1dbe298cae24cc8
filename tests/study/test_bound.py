"""The least number of tests is never more than what the best of all strategies needs."""

import math
from functools import cache
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.study.results import least_tests

MANY = st.integers(1, 2000)


def least_to_show(*known):
    return least_tests(*known)[0]


def least_to_find(*known):
    return least_tests(*known)[1]


def subsets(models, sizes):
    """Sets of models as bits."""
    return frozenset(
        sum(1 << model for model in chosen) for size in sizes for chosen in combinations(range(models), size)
    )


def optimum(models, needed, iterations, sizes):
    """Tests that the best strategy takes in the worst case to tell which `needed` models of `models` it is that f needs.

    It knows beforehand that f needs so many of them as one of `sizes` says, and that it shows wherever all of those are.
    """

    @cache
    def worst(possible):
        if len(possible) == 1 or not any(each.bit_count() == needed for each in possible):
            return 0
        best = math.inf
        for kept in range(1 << models):
            similar = frozenset(each for each in possible if not each & ~kept)
            if 0 < len(similar) < len(possible):
                best = min(best, max(_way(1, similar), _way(1 + iterations, possible - similar)))
        return best

    def _way(cost, possible):
        """Ways on which no set of the right size lies do not count."""
        return cost + worst(possible) if any(each.bit_count() == needed for each in possible) else 0

    return worst(subsets(models, sizes))


@pytest.mark.parametrize("iterations", [0, 1, 3])
@pytest.mark.parametrize("models", [1, 2, 3, 4, 5])
def test_who_knows_how_many_are_needed_takes_as_many_as_it_takes_to_find_them(models, iterations):
    for needed in range(1, models + 1):
        best = optimum(models, needed, iterations, (needed,))
        shown = least_to_show(models, needed, 1 + iterations, 0)
        assert shown <= least_to_find(models, needed, 1 + iterations, 0) <= max(best, shown)


@pytest.mark.parametrize("iterations", [0, 2])
@pytest.mark.parametrize("models", [1, 2, 3])
def test_who_knows_nothing_beforehand_has_to_show_it_too(models, iterations):
    for needed in range(1, models + 1):
        best = optimum(models, needed, iterations, range(models + 1))
        assert (
            least_to_show(models, needed, 1 + iterations, 0) <= least_to_find(models, needed, 1 + iterations, 0) <= best
        )


def test_some_strategies_need_no_more():
    """The bound can be reached: halving finds one model; if all are needed, each is left out without success."""
    assert least_to_show(1, 1, 4, 10) == least_to_find(1, 1, 4, 10) == 10 + 4
    assert least_to_show(4, 4, 2, 3) == least_to_find(4, 4, 2, 3) == 3 + 8
    assert least_to_show(16, 2, 4, 10) == 10 + 1 + 8
    for models in (4, 8, 1024):
        assert least_to_find(models, 1, 1, 0) == math.log2(models)
    assert optimum(5, 2, 0, (2,)) == least_to_find(5, 2, 1, 0) == 4


@given(MANY, st.integers(0, 2000), st.integers(0, 50))
def test_without_reruns_a_test_tells_one_bit(models, needed, baseline_runs):
    needed = min(needed, models)
    bits = (math.comb(models, needed) - 1).bit_length()
    shown = needed + (needed < models)
    assert least_to_find(models, needed, 1, baseline_runs) == baseline_runs + max(shown, bits)


@pytest.mark.parametrize("bound", [least_to_show, least_to_find])
@given(MANY, st.integers(0, 2000), st.integers(1, 20), st.integers(0, 50))
def test_more_reruns_never_make_it_less(bound, models, needed, misses, baseline_runs):
    needed = min(needed, models)
    least = bound(models, needed, misses, baseline_runs)
    assert baseline_runs <= least <= bound(models, needed, misses + 1, baseline_runs)
    # Each test of a tree without re-runs becomes as many at the most.
    assert least - baseline_runs <= misses * bound(models, needed, 1, 0)
