"""When a candidate is taken: soon where it is clear, and never against what its runs show."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.reduction.verdict import MOST_RUNS, Acceptance, estimated_rate
from tests.tiers import slow

keeping = st.builds(Acceptance, st.integers(1, 12), st.floats(0.05, 1), st.floats(0.3, 0.95), st.integers(0, 3))
ORDER = {"dissimilar": 0, "": 1, "similar": 2}


@given(most_misses=st.integers(1, 12))
def test_by_the_papers_rule_the_first_hit_decides(most_misses):
    rule = Acceptance(most_misses)
    assert [rule.verdict(0, misses) for misses in range(most_misses)] == [""] * most_misses
    assert rule.verdict(0, most_misses) == "dissimilar"
    assert {rule.verdict(1, misses) for misses in range(most_misses)} == {"similar"}


@given(rule=keeping, shown=st.integers(0, 30), missed=st.integers(0, 30))
def test_a_hit_never_speaks_against_a_candidate(rule, shown, missed):
    assert ORDER[rule.verdict(shown + 1, missed)] >= ORDER[rule.verdict(shown, missed)]
    if shown + missed < MOST_RUNS - 1:
        assert ORDER[rule.verdict(shown, missed + 1)] <= ORDER[rule.verdict(shown, missed)]


@given(rule=keeping, seed=st.integers(0, 10**6), rate=st.floats(0, 1))
def test_every_candidate_is_decided_and_one_without_a_hit_costs_no_more_than_by_the_papers_rule(rule, seed, rate):
    draw, shown, missed = random.Random(seed), 0, 0
    while not rule.verdict(shown, missed):
        hit = draw.random() < rate
        shown, missed = shown + hit, missed + (not hit)
    assert shown + missed <= MOST_RUNS
    assert shown or missed == rule.misses <= rule.most_misses


def test_where_f_always_shows_one_hit_or_two_misses_are_enough():
    rule = Acceptance(4, estimated_rate(10, 10))
    assert rule.verdict(1, 0) == "similar"
    assert rule.verdict(0, 1) == ""
    assert rule.verdict(0, 2) == "dissimilar"


def test_after_a_step_back_more_hits_are_asked_for():
    hits = [
        next(hits for hits in range(1, 50) if Acceptance(4, 0.9, steps_back=back).verdict(hits, 0) == "similar")
        for back in range(4)
    ]
    assert hits == sorted(hits)
    assert hits[1] > hits[0]


def share_taken(rule, rate, seed):
    draw, taken = random.Random(seed), 0
    for _ in range(2000):
        shown = missed = 0
        while not (verdict := rule.verdict(shown, missed)):
            hit = draw.random() < rate
            shown, missed = shown + hit, missed + (not hit)
        taken += verdict == "similar"
    return taken / 2000


@pytest.mark.parametrize("rate", slow(pytest.mark.rates, [0.5, 0.65, 0.8, 0.95, 1.0], but=[0.95]))
def test_what_keeps_the_rate_is_taken_and_what_shows_f_by_chance_is_not(rate):
    """As often as four runs find it, and far less often than they take another failure."""
    rule = Acceptance(4, estimated_rate(round(20 * rate), 20))
    assert share_taken(rule, rate, 1) >= 0.9
    assert share_taken(rule, 0.03, 2) <= 0.06
    # Of a world that shows f in a quarter of the cases, the paper's rule takes 68 %.
    assert share_taken(rule, 0.25 * rate, 3) <= 0.45
