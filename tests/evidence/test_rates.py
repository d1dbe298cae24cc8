"""What runs say of a rate: intervals, re-runs, and which of two rates they speak for."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.evidence.rates import iterations_needed, miss_chance, shows_at, wilson_interval


def test_wilson_interval_matches_the_textbook():
    # Wilson (1927) for 8 of 10: 0.4902 to 0.9433.
    assert wilson_interval(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)


def test_wilson_interval_of_ten_runs_covers_as_many_rates_as_the_docs_say():
    intervals = [wilson_interval(shown, 10) for shown in range(11)]

    def covered(rate):
        chances = [
            math.comb(10, shown) * rate**shown * (1 - rate) ** (10 - shown) for shown in range(11)
        ]
        return sum(
            chance
            for chance, (low, high) in zip(chances, intervals, strict=True)
            if low <= rate <= high
        )

    shares = [covered(place / 1000) for place in range(1, 1000)]
    assert sum(shares) / len(shares) == pytest.approx(0.95, abs=0.005)
    assert min(shares) == pytest.approx(0.84, abs=0.005)


@given(trials=st.integers(1, 200), data=st.data())
def test_the_interval_holds_the_rate_and_stays_a_probability(trials, data):
    successes = data.draw(st.integers(0, trials))
    low, high = wilson_interval(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1


@pytest.mark.parametrize(("successes", "trials"), [(1, 0), (3, 2), (-1, 4)])
def test_impossible_counts_are_refused(successes, trials):
    with pytest.raises(ValueError):
        wilson_interval(successes, trials)


@given(rate=st.floats(0.01, 1.0))
def test_the_iterations_needed_are_enough_and_no_more(rate):
    needed = iterations_needed(rate)
    assert miss_chance(rate, needed) <= 0.05 + 1e-9
    assert needed == 0 or miss_chance(rate, needed - 1) > 0.05 - 1e-9


@given(st.floats(0.3, 1.0), st.booleans(), st.integers(0, 2**32))
def test_runs_decide_between_a_rate_and_half_of_it_and_are_seldom_wrong(rate, fails, seed):
    chance = random.Random(seed)
    p = rate if fails else rate / 2
    said = [shows_at((chance.random() < p for _ in range(400)), rate) for _ in range(60)]
    # Each is wrong with at most about 1 %: seven of sixty would be so by chance once in ten million
    # times.
    assert sum(each is not fails for each in said) < 7


def test_a_failure_that_always_shows_takes_seven_runs_and_one_that_never_shows_fewer():
    assert shows_at([True] * 6, 0.9) is None
    assert shows_at([True] * 7, 0.9) is True
    assert shows_at([False] * 3, 0.9) is False
    assert shows_at([], 0.9) is None
