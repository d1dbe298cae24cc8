"""Isolation as a pure search: what it removes lets the robot pass, and not with any one model of it
put back.
"""

import random
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import NOTHING, Environment
from ddenv.evidence.certificate import settle
from ddenv.evidence.rates import estimated_rate
from ddenv.reduction.isolation import MOST_RUNS, Asked, Passing, isolating, isolation, passes
from ddenv.reduction.round import Stacks
from ddenv.reduction.verdict import standing
from tests.reduction.driving import Driver, Known, World
from tests.reduction.worlds import carried_through, tried
from tests.tiers import examples

MODELS = tuple(range(12))
groups = st.lists(
    st.sets(st.sampled_from(MODELS), min_size=1, max_size=4).map(Environment.of),
    min_size=1,
    max_size=4,
)


def search(searching, passing):
    """What is removed at the end, and all removals that were tried, in order."""
    removed, rounds = carried_through(searching, passing)
    return removed, [one.models for round, winner in rounds for one in tried(round, winner)]


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


@given(passing=st.sets(st.integers(1, 31).map(Environment)), first=st.integers(1, 5))
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
        return standing([0], lambda _, run: made.random() < rate, rule)[0][0]

    assert sum(found(rule.wanted) == "similar" for _ in range(400)) >= 360
    assert sum(found(rule.rather_than) == "similar" for _ in range(400)) <= 40


def test_fresh_runs_that_do_not_decide_show_nothing():
    rule, world = Passing(0.9, 0.45, 0.01), Environment.of((0,))
    every = settle(passes(world, rule, 20), lambda *_: True)
    assert (every.verdict, len(every.rests_on)) == ("passes", 20)
    assert settle(passes(world, rule, 20), lambda *_: False).verdict == "fails"
    some = settle(passes(world, rule, 20), lambda _, run: run % 7 not in (2, 5))
    assert (some.verdict, len(some.rests_on)) == ("not shown", MOST_RUNS)
    assert settle(passes(world, rule, 20), lambda *_: "broken").verdict == "unknown"


def isolated(world, passing, rates=(1.0, 0.0), checks=(), **options):
    """A driver of the isolation of a world, and what has to go; runs reach the goal at one rate or
    the other.
    """
    driver = Driver(world, **options)

    def reached(environment, run):
        draw = random.Random(f"{world.seed} {environment.bits} {run}")
        return (
            "broken"
            if draw.random() < world.breaks
            else draw.random() < rates[not passing(world.whole - environment)]
        )

    driver.outcome = reached
    stacks = Stacks.of(world.stack(label) for label in dict.fromkeys(world.labels))
    asked = Asked(
        whole=world.whole,
        suspects=stacks.representatives[::-1],
        stacks=stacks,
        size=1,
        rule=Passing.of(0, 10),
        keep_rate=0.8,
        at_least=5,
        first_run=10_000,
        block=1_000,
    )
    return driver, driver.drive(isolation(driver, asked, checks)), stacks


isolations = st.builds(
    World,
    labels=st.lists(st.integers(0, 5), min_size=1, max_size=7).map(tuple),
    needed=st.just(NOTHING),
    useful=st.just(NOTHING),
    algorithm=st.just("ddmin"),
    seed=st.integers(0, 10**6),
    breaks=st.sampled_from([0.0, 0.02]),
)
causes = st.lists(
    st.sets(st.integers(0, 7), min_size=1, max_size=3).map(Environment.of), min_size=1, max_size=3
)


@given(world=isolations.map(lambda world: replace(world, breaks=0.0)), causes=causes)
def test_fresh_runs_show_that_what_goes_is_enough_and_each_of_it_needed(world, causes):
    """Model 7 stands in no world: a cause of it alone cannot be taken away."""
    passing = hits(causes)
    driver, removed, stacks = isolated(world, passing)
    if removed is None:
        assert not passing(world.whole)
        return
    assert passing(removed)
    gone = [stack for stack in stacks.by_first.values() if not stack.isdisjoint(removed)]
    assert removed == Environment.of(model for stack in gone for model in stack)
    assert not any(passing(removed - stack) for stack in gone)
    passes, *backs = driver.facts[-1][1].claims
    assert passes.claim.verdict == "passes"
    assert [claim.claim.verdict for claim in backs] == ["needed"] * len(gone)


@given(world=isolations, causes=causes, workers=st.integers(2, 9))
def test_an_isolation_does_not_depend_on_what_ends_first_and_is_taken_up_again(
    world, causes, workers
):
    passing, rates = hits(causes), (0.97, 0.1)
    alone, removed, _ = isolated(world, passing, rates)
    together, same, _ = isolated(world, passing, rates, workers=workers, order=1)
    assert (together.facts, same) == (alone.facts, removed)
    checks = [fact[1] for fact in alone.facts if fact[0] == "checked"]
    for known in range(len(checks) + 1):
        again, same, _ = isolated(
            world, passing, rates, checks[:known], known=Known(dict(alone.known.outcomes))
        )
        assert (again.made, same) == ([], removed)
