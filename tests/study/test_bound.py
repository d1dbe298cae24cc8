"""The least number of tests is never more than what the best of all strategies needs."""

import math
from functools import cache
from itertools import combinations
from types import SimpleNamespace

import pytest

from ddenv.study.results import Result


def subsets(models, sizes):
    """Sets of models as bits."""
    return frozenset(
        sum(1 << model for model in chosen)
        for size in sizes
        for chosen in combinations(range(models), size)
    )


def optimum(models, needed, iterations, sizes):
    """Tests that the best strategy takes in the worst case to tell which `needed` models of
    `models` it is that f needs.

    It knows beforehand that f needs so many of them as one of `sizes` says, and that it shows
    wherever all of those are.
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


def bound(models, needed, misses, baseline_runs=0):
    """That of a result which has left `needed` of `models` models."""
    cell = SimpleNamespace(
        scenario=SimpleNamespace(reduction=SimpleNamespace(baseline_runs=baseline_runs))
    )
    names = tuple(map(str, range(models)))
    return Result(cell=cell, elements=names, left=names[:needed], misses=misses).bound


@pytest.mark.parametrize("iterations", [0, 2])
@pytest.mark.parametrize("models", [1, 2, 3])
def test_no_strategy_takes_fewer(models, iterations):
    """One that knows nothing has at least to show the end."""
    for needed in range(1, models + 1):
        best = optimum(models, needed, iterations, range(models + 1))
        assert bound(models, needed, 1 + iterations) <= best
