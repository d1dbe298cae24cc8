"""Margins: what is found of a number covers the truth, whatever the rate of f; and it asks for few
runs, each in its turn.
"""

import itertools
import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.evidence.margins import MOST_OF_NUMBER, Known, Rule, margin_of, steps, wanted
from ddenv.runfile.events import NumberAsked
from tests.tiers import examples, slow

PLACE = NumberAsked(
    name="barrel.y", now=0.5, low=-2.5, high=3.5, scale=3.0, resolution=0.01, unit="m"
)
FRICTION = NumberAsked(
    name="patch.friction", now=0.0015, low=0.0, high=1.0, scale=1.0, resolution=0.002
)
# The error of one verdict where all of some fifteen values of a number are right in 95 of 100.
ERROR = 0.05 / 15


def explored(
    asked, rate, runs_of, most=MOST_OF_NUMBER, impossible=lambda value: False, chosen=None
):
    """The margin of a number whose run i at a value ends as `runs_of(value, i)`; runs end in any
    order with `chosen`.
    """
    rule, made, refused = Rule(rate, ERROR), {}, {}
    while True:
        known = Known(
            {
                value: [runs[run] for run in range(len(runs)) if run in runs]
                for value, runs in made.items()
            },
            {},
            refused,
        )
        asks = list(wanted(asked, rule, known, most))
        if not asks:
            return margin_of(asked, rule, known)
        value, run = asks[0] if chosen is None else chosen.choice(asks)
        if run == 0 and impossible(value):
            refused[value] = "it is in a wall"
            continue
        # What is surely needed is needed in its order, too.
        if all(earlier in made.get(value, {}) for earlier in range(run)):
            made.setdefault(value, {})[run] = runs_of(value, run)


def planted(asked, rate, limit, goal, salt):
    """f shows at `rate` below `limit`, and from `goal` on the robot nearly always reaches its
    goal.
    """

    def outcome(value, run):
        random_one = random.Random(f"{salt} {value} {run}")
        if value < limit:
            return "similar" if random_one.random() < rate else random_one.choice(["other", "pass"])
        return "pass" if value >= goal and random_one.random() < 0.97 else "other"

    return outcome


@pytest.mark.parametrize(
    "case",
    slow(
        pytest.mark.rates,
        itertools.product((PLACE, FRICTION), (1.0, 0.9, 0.7)),
        but=[(FRICTION, 0.9)],
    ),
)
def test_the_interval_found_covers_the_truth(case):
    asked, rate = case
    covered = narrow = 0
    for salt in range(100):
        chance = random.Random(salt)
        reach = asked.high - asked.now
        limit = asked.now + math.exp(chance.uniform(math.log(0.02), math.log(0.8))) * reach
        goal = limit * chance.choice([1.0, 1.0, 1.3])
        side = explored(asked, rate, planted(asked, rate, limit, goal, salt)).up
        low = asked.now if side.until is None else side.until.value
        high = math.inf if side.gone is None else side.gone.value
        covered += low < limit <= high and (side.goal is None or side.goal.value >= goal)
        narrow += high - low < 0.5 * (limit - asked.now)
    assert covered >= 95
    # An interval that says nothing would cover all.
    assert narrow >= (80 if rate > 0.8 else 15)


@given(limit=st.floats(0.6, 3.4), salt=st.integers(0, 99), chance=st.randoms(use_true_random=False))
@examples(1)
def test_runs_are_few_and_none_is_made_in_vain_whoever_makes_them(limit, salt, chance):
    truth = planted(PLACE, 0.9, limit, limit + 0.3, salt)
    margin = explored(PLACE, 0.9, truth)
    assert margin.runs <= MOST_OF_NUMBER
    for value in (*margin.down.tried, *margin.up.tried):
        # The last run decides.
        assert not Rule(0.9, ERROR).verdict(value.outcomes[:-1])
    assert explored(PLACE, 0.9, truth, chosen=chance) == margin


def test_nothing_is_assumed_between_the_values_or_beyond_them():
    """f shows again beyond where it is gone, and the goal is reached before it."""
    goals = list(steps(PLACE, True))[1:2]
    margin = explored(PLACE, 1.0, lambda value, _: "pass" if value in goals else "similar")
    assert margin.up.goal.value == goals[0]
    assert margin.up.until.value < goals[0]
    # What is beyond was tried, so the goal is not said to be reached to the end of the range.
    assert margin.up.again.value == PLACE.high
    assert not margin.up.to_end
    assert (margin.down.until.value, margin.down.gone) == (PLACE.low, None)
    other = explored(PLACE, 1.0, lambda value, _: "other" if value in goals else "similar")
    assert (other.up.gone.value, other.up.again.value, other.up.goal) == (
        goals[0],
        PLACE.high,
        None,
    )


@given(limit=st.floats(0.6, 3.2), window=st.floats(0.2, 3.0))
@examples(2)
def test_the_goal_is_said_to_be_reached_to_the_end_only_where_runs_beyond_reached_it(limit, window):
    """`window` m farther than from where it is reached, it is not."""

    def outcome(value, _):
        return "similar" if value < limit else "pass" if value < limit + window else "other"

    side = explored(PLACE, 1.0, outcome).up
    assert side.goal is None or side.to_end == (
        limit + window > PLACE.high and side.goal.value < PLACE.high
    )
    if side.to_end:
        values = [one.value for one in side.tried if one.value >= side.goal.value]
        assert PLACE.high in values and len(values) >= 4


def test_a_value_that_is_not_possible_costs_no_run_and_bounds_the_search():
    margin = explored(PLACE, 1.0, lambda *_: "similar", impossible=lambda value: value > 1.1)
    assert margin.up.gone.verdict == "impossible"
    assert margin.up.until.value <= 1.1 < margin.up.gone.value
    assert margin.up.gone.value - margin.up.until.value <= 0.1 * (margin.up.gone.value - PLACE.now)
    assert not margin.up.gone.outcomes


def test_a_value_between_stays_undecided_and_broken_runs_say_nothing():
    rule = Rule(0.95, ERROR)
    half = ["similar", "other", "other", "similar"] * 8
    assert rule.verdict(["error"] * 15) == ""
    assert rule.verdict(["error"] * 16) == "undecided"
    assert rule.verdict(["error", *["pass"] * 7]) == "goal"
    # As little may be said of what shows f in half of its runs as its few runs allow.
    assert rule.verdict(half) in ("f", "undecided")
    assert rule.verdict(["other"] * 4 + ["pass"] * 4 + ["other", "pass"] * 4) == "other"
