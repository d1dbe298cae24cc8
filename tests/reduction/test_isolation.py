"""Isolation as a pure search: what it removes lets the robot pass, and not with any one model of it put back."""

import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import NOTHING, Environment
from ddenv.evidence.certificate import settle
from ddenv.evidence.rates import estimated_rate
from ddenv.reduction.isolation import MOST_RUNS, Passing, isolating, passes
from ddenv.reduction.stacks import Stacks
from ddenv.reduction.verdict import standing
from tests.tiers import examples

MODELS = tuple(range(12))
groups = st.lists(st.sets(st.sampled_from(MODELS), min_size=1, max_size=4).map(Environment.of), min_size=1, max_size=4)


def search(searching, passing):
    """What is removed at the end, and all removals that were tried, in order."""
    tried, winner = [], None
    try:
        while True:
            round = searching.send(winner)
            winner = None
            for one in round.candidates:
                tried.append(one.models)
                if passing(one.models):
                    winner = one
                    break
    except StopIteration as end:
        return end.value, tried


def hits(groups):
    """The robot fails as long as all models of any group are there: one of each has to go."""
    return lambda removed: all(not group.isdisjoint(removed) for group in groups)


@given(groups=groups, first=st.integers(0, 14), order=st.permutations(MODELS))
@examples(3)
def test_what_goes_lets_the_robot_pass_and_not_with_any_one_model_put_back(groups, first, order):
    passing = hits(groups)
    removed, tried = search(isolating(tuple(order), first), passing)
    assert passing(removed)
    put_back = {removed - Environment.of((model,)) for model in removed}
    assert not any(map(passing, put_back))
    # Tests showed it: each of these was tried, unless nothing would be removed.
    assert removed in tried
    assert put_back - {NOTHING} <= set(tried)


@given(
    passing=st.sets(st.integers(1, 31).map(Environment)),
    first=st.integers(1, 5),
)
@examples(3)
def test_it_is_one_minimal_whatever_passes(passing, first):
    """Also where a larger removal fails again."""
    removed, _ = search(isolating(MODELS[:5], first), passing.__contains__)
    if removed:
        assert removed in passing
        assert not any(removed - Environment.of((model,)) in passing for model in removed)
    else:
        assert Environment.whole(5) not in passing


def test_what_the_reduction_left_goes_first_and_then_twice_as_many():
    _, tried = search(isolating(MODELS, 2), lambda _: False)
    assert [len(each) for each in tried] == [2, 4, 8, 12]
    assert all(few < many for few, many in pairwise(tried))
    assert search(isolating((), 3), lambda _: True) == (NOTHING, [])


def test_a_stack_goes_or_stays_as_a_whole():
    stacks = Stacks.of(map(Environment.of, ([0], [1, 2, 3], [4, 5])))
    removed, tried = search(stacks.expand(isolating(stacks.representatives, 1)), hits([Environment.of((2, 9))]))
    assert removed == Environment.of((1, 2, 3))
    assert all(each & stack in (NOTHING, stack) for each in tried for stack in stacks.by_first.values())


@pytest.mark.parametrize(("reached", "runs"), [(0, 5), (3, 10), (8, 10), (55, 60)])
def test_one_run_that_reaches_the_goal_does_not_pass(reached, runs):
    rule = Passing.of(reached, runs)
    assert 0 < rule.rather_than < rule.wanted < 1
    assert rule.verdict(1, 0) == rule.verdict(3, 0) == ""
    assert rule.rather_than >= estimated_rate(reached, runs)
    decided = next(hits for hits in range(200) if rule.verdict(hits, 0))
    assert rule.verdict(decided, 0) == "similar"
    assert rule.verdict(0, 2) == "dissimilar"
    assert all(rule.verdict(hits, MOST_RUNS - hits) for hits in range(MOST_RUNS))


def test_the_rule_is_seldom_wrong_at_either_of_its_rates():
    rule, made = Passing.of(0, 10), random.Random(4)

    def found(rate):
        return standing([0], lambda _, run: made.random() < rate, rule).verdicts[0]

    assert sum(found(rule.wanted) == "similar" for _ in range(400)) >= 360
    assert sum(found(rule.rather_than) == "similar" for _ in range(400)) <= 40


def test_fresh_runs_that_do_not_decide_show_nothing():
    rule, world = Passing(0.9, 0.45, 0.01), Environment.of((0,))
    every = settle(passes(world, rule, 20), lambda *_: True)
    assert (every.verdict, every.runs) == ("passes", 20)
    assert settle(passes(world, rule, 20), lambda *_: False).verdict == "fails"
    some = settle(passes(world, rule, 20), lambda _, run: run % 7 not in (2, 5))
    assert (some.verdict, some.runs) == ("not shown", MOST_RUNS)
    assert settle(passes(world, rule, 20), lambda *_: "broken").verdict == "unknown"
