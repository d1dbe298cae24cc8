"""The least number of tests is never more than what the best of all strategies needs."""

import math
from functools import cache
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.study.results import least_tests

MANY = st.integers(1, 2000)


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


@pytest.mark.parametrize(("most", "iterations"), [(5, 0), (5, 1), (5, 3), (3, 0), (3, 2)])
def test_no_strategy_takes_fewer(most, iterations):
    """Who knows how many models are needed has only to find them; up to three models, who knows nothing is tried, too."""
    for models in range(1, most + 1):
        for needed in range(1, models + 1):
            to_show, to_find = least_tests(models, needed, 1 + iterations, 0)
            sizes = range(models + 1) if most == 3 else (needed,)
            best = optimum(models, needed, iterations, sizes)
            assert to_show <= to_find <= (best if most == 3 else max(best, to_show))


def test_some_strategies_need_no_more():
    """The bound can be reached: halving finds one model; if all are needed, each is left out without success."""
    assert least_tests(1, 1, 4, 10) == (10 + 4,) * 2
    assert least_tests(4, 4, 2, 3) == (3 + 8,) * 2
    assert least_tests(16, 2, 4, 10)[0] == 10 + 1 + 8
    for models in (4, 8, 1024):
        assert least_tests(models, 1, 1, 0)[1] == math.log2(models)
    assert optimum(5, 2, 0, (2,)) == least_tests(5, 2, 1, 0)[1] == 4


@given(MANY, st.integers(0, 2000), st.integers(1, 20), st.integers(0, 50))
def test_without_reruns_a_test_tells_one_bit_and_more_reruns_never_make_it_less(models, needed, misses, baseline_runs):
    needed = min(needed, models)
    bits = (math.comb(models, needed) - 1).bit_length()
    shown = needed + (needed < models)
    single = least_tests(models, needed, 1, 0)
    assert single == (shown, max(shown, bits))
    fewer, more = (least_tests(models, needed, each, baseline_runs) for each in (misses, misses + 1))
    for least, next_one, one in zip(fewer, more, single, strict=True):
        assert baseline_runs <= least <= next_one
        # Each test of a tree without re-runs becomes as many at the most.
        assert least - baseline_runs <= misses * one
