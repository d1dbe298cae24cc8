"""What runs with one number changed show: whether f still shows at a value, and what a number's values add up to.

Nothing is assumed between the values that were tried, or beyond them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count, takewhile
from typing import Literal

from ddenv.evidence.rates import leans_to
from ddenv.runfile.events import NumberAsked
from ddenv.runfile.progress import Margins, NumberTried

# "f" still shows, the robot reaches its "goal" instead, "other" things happen; "undecided" after the most runs that a value gets,
# "impossible" in the world, "" while it is open.
Verdict = Literal["f", "goal", "other", "undecided", "impossible", ""]
# f still shows at `SHOWS` of its rate rather than at `GONE` of it; the robot reaches its goal at the rate `REACHED`, not `MISSED`.
SHOWS, GONE = 0.9, 0.1
REACHED, MISSED = 0.9, 0.1
# The chance that any claim of a call is wrong is at most this.
ERROR = 0.05
# After this many runs a value stays undecided.
MOST_RUNS = 16
# The maximum number of runs for one number; and where several share a budget, in a first look at each of them.
MOST_OF_NUMBER, FIRST_LOOK = 60, 32
# Where f shows more rarely than this in what is left, no few runs say where it is gone.
RAREST = 0.25
# So many fresh runs judge the nearest fix, from this run on: far from all runs of a reduction, its certificates and isolations.
FIX_RUNS, FIRST_FIX_RUN = 20, 500_000_000
# Fresh runs judge so many fixes at most.
MOST_FIXES = 3


@dataclass(frozen=True, slots=True)
class Rule:
    """Wald's sequential tests of a value, where f shows at `rate` at the present one; a verdict is wrong with a probability of at
    most `error`.
    """

    rate: float
    error: float

    def verdict(self, outcomes: Sequence[str]) -> Verdict:
        """What the outcomes of runs 0, 1, ... show; "" while they do not decide. Runs beyond the decision do not change it."""
        f = goal = sound = 0
        gone = reached = None
        for number, outcome in enumerate(outcomes, 1):
            # A broken run says nothing, and counts only against the patience.
            if outcome not in ("error", "timeout"):
                f, goal, sound = f + (outcome == "similar"), goal + (outcome == "pass"), sound + 1
                if gone is None and (found := self._leans(f, sound, SHOWS * self.rate, GONE * self.rate)) is not None:
                    gone = not found
                if reached is None:
                    reached = self._leans(goal, sound, REACHED, MISSED)
            if gone is False:
                return "f"
            if gone and reached is not None:
                return "goal" if reached else "other"
            if number >= MOST_RUNS:
                return "other" if gone else "undecided"
        return ""

    def _leans(self, hits: int, runs: int, rate: float, other: float) -> bool | None:
        # Two claims may be wrong: on f, and on the goal.
        return leans_to(hits, runs - hits, rate, other, self.error / 2.0)

    def surely_needed(self, outcomes: Sequence[str]) -> int:
        """How many more runs a value needs at least, whatever they show; 0 if it is decided."""
        more = 0
        while not any(self.verdict([*outcomes, *[each] * more]) for each in ("similar", "pass", "other")):
            more += 1
        return more


@dataclass(frozen=True, slots=True)
class Value:
    """A value that was tried, and its verdict. `outcomes` are those of its runs in their order; `failures` say how each failed.

    `why` it is not possible.
    """

    value: float
    verdict: Verdict
    outcomes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    why: str = ""

    @property
    def shown(self) -> int:
        """In how many runs f showed."""
        return self.outcomes.count("similar")

    @property
    def reached(self) -> int:
        """In how many runs the robot reached its goal."""
        return self.outcomes.count("pass")


@dataclass(frozen=True, slots=True)
class Side:
    """The values tried on one side of the present one, `up` or down, the nearest first.

    `until`: the farthest up to which f shows at all values that were decided; None where the present one is that. `gone`: the
    nearest at which it does not show, or which is not possible. `goal`: the nearest at which the robot reaches its goal. `again`:
    the farthest at which f shows beyond `gone`. `end` is where the range ends.
    """

    up: bool
    tried: tuple[Value, ...]
    end: float
    until: Value | None = None
    gone: Value | None = None
    goal: Value | None = None
    again: Value | None = None


@dataclass(frozen=True, slots=True)
class Margin:
    """What is known of a number: on both sides of its present value, by `runs` runs in all."""

    asked: NumberAsked
    down: Side
    up: Side
    runs: int

    @property
    def sides(self) -> tuple[Side, Side]:
        return self.down, self.up


def rule_of(tried: NumberTried) -> Rule:
    """The rule by which the values of a number are judged."""
    return Rule(tried.rate, tried.error)


def margin_of(asked: NumberAsked, rule: Rule, known: Known) -> Margin:
    """The margin of a number, by what is known of its values."""
    values = sorted((_value(value, rule, known) for value in known.values()), key=lambda one: one.value)
    down = [one for one in reversed(values) if one.value < asked.now]
    up = [one for one in values if one.value > asked.now]
    runs = sum(map(len, known.outcomes.values()))
    return Margin(asked, _side(False, down, asked.low), _side(True, up, asked.high), runs)


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of a number's values: the outcomes of runs 0, 1, ..., how each failed, and why some are not possible."""

    outcomes: Mapping[float, Sequence[str]] = field(default_factory=dict)
    failures: Mapping[float, Sequence[str]] = field(default_factory=dict)
    impossible: Mapping[float, str] = field(default_factory=dict)

    def values(self) -> list[float]:
        """All values that were tried."""
        return sorted({*self.outcomes, *self.impossible})


def known_of(margins: Margins, name: str) -> Known:
    """What the runs of the search show of a number; a value's runs count up to the first that is not finished."""
    runs: dict[float, dict[int, tuple[str, str]]] = {}
    for one in margins.runs:
        if one.name == name and one.run < FIRST_FIX_RUN:
            runs.setdefault(one.value, {})[one.run] = one.outcome, one.failure
    outcomes: dict[float, list[str]] = {}
    failures: dict[float, list[str]] = {}
    for value, by_run in runs.items():
        finished = [by_run[run] for run in takewhile(by_run.__contains__, count())]
        outcomes[value], failures[value] = [one for one, _ in finished], [how for _, how in finished]
    impossible = {one.value: one.why for one in margins.impossible if one.name == name}
    return Known(outcomes, failures, impossible)


def margins_of(margins: Margins) -> tuple[Margin, ...]:
    """The margins of all numbers with a value that was tried, in the order in which they were asked for."""
    found = (margin_of(one.asked, rule_of(one), known_of(margins, one.asked.name)) for one in margins.numbers)
    return tuple(one for one in found if one.up.tried or one.down.tried)


def _value(value: float, rule: Rule, known: Known) -> Value:
    if value in known.impossible:
        return Value(value, "impossible", why=known.impossible[value])
    outcomes, failures = tuple(known.outcomes[value]), tuple(known.failures.get(value, ()))
    return Value(value, rule.verdict(outcomes), outcomes, failures)


def _side(up: bool, tried: Sequence[Value], end: float) -> Side:
    gone = next(
        (place for place, one in enumerate(tried) if one.verdict in ("goal", "other", "impossible")), len(tried)
    )
    shows = [one for one in tried[:gone] if one.verdict == "f"]
    again = [one for one in tried[gone:] if one.verdict == "f"]
    return Side(
        up=up,
        tried=tuple(tried),
        end=end,
        until=shows[-1] if shows else None,
        gone=tried[gone] if gone < len(tried) else None,
        goal=next((one for one in tried if one.verdict == "goal"), None),
        again=again[-1] if again else None,
    )


@dataclass(frozen=True, slots=True)
class Fix:
    """A changed number with which the robot reaches its goal, by runs of the search; `share` of the number's scale it is changed.

    Of `runs` fresh runs it `reached` its goal in so many; `confirmed`: they show that it does.
    """

    name: str
    value: float
    share: float
    reached: int
    runs: int
    confirmed: bool | None


def fixes_of(margins: Margins) -> tuple[Fix, ...]:
    """All values at which the robot reached its goal, the smallest change first."""
    values = (
        (one.asked, value) for one in margins_of(margins) for side in one.sides for value in side.tried
        if value.verdict == "goal"
    )  # fmt: skip
    found = [_fix(margins, asked, value.value) for asked, value in values]
    return tuple(sorted(found, key=lambda one: (one.share, one.name)))


def _fix(margins: Margins, asked: NumberAsked, value: float) -> Fix:
    fresh = {
        one.run: one.outcome
        for one in margins.runs
        if (one.name, one.value) == (asked.name, value) and one.run >= FIRST_FIX_RUN
    }
    reached, runs = sum(outcome == "pass" for outcome in fresh.values()), len(fresh)
    # A run that broke counts against it.
    confirmed = None if runs < FIX_RUNS else leans_to(reached, runs - reached, REACHED, REACHED / 2.0, ERROR) is True
    return Fix(asked.name, value, abs(value - asked.now) / asked.scale, reached, runs, confirmed)
