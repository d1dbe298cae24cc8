import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.rates import iterations_needed, miss_chance, wilson_interval


def test_wilson_interval_matches_the_textbook():
    # Wilson (1927) for 8 of 10: 0.4902 to 0.9433.
    assert wilson_interval(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)


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
