"""What runs with one number changed show: whether f still shows at a value, what a number's values
add up to, and which is tried next: outward from the present one by growing steps, then by halves
between values with other verdicts.

Nothing is assumed between the values that were tried, or beyond them. All follows from what is
known of the values.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, takewhile
from typing import Literal

from ddenv.evidence.rates import leans_to
from ddenv.run_numbers import FIXES
from ddenv.runfile.events import NumberAsked
from ddenv.runfile.progress import Margins
from ddenv.runfile.state import BROKEN
from ddenv.text import Names

# "f" still shows, the robot reaches its "goal" instead, "other" things happen; "undecided" after
# the most runs that a value gets, "impossible" in the world, "" while it is open.
Verdict = Literal["f", "goal", "other", "undecided", "impossible", ""]
# f still shows at `SHOWS` of its rate rather than at `GONE` of it; the robot reaches its goal at
# the rate `REACHED`, not `MISSED`.
SHOWS = 0.9
GONE = 0.1
REACHED = 0.9
MISSED = 0.25
# The chance that any claim of a call is wrong is at most this.
ERROR = 0.05
# The maximum number of runs of a value, of a number, and of that in a first look where several
# share a budget.
MOST_RUNS = 16
MOST_OF_NUMBER = 120
FIRST_LOOK = 32
# Where f shows more rarely than this in what is left, no few runs say where it is gone.
RAREST = 0.25
# So many fresh runs judge each of so many fixes.
FIX_RUNS = 20
MOST_FIXES = 3
# Values are tried outward from the present one by growing steps: so many to the end of the range,
# the first as a share of it.
STEPS = 3
FIRST_SHARE = 1.0 / 16.0
# The values between the nearest one at which the goal is reached and the end of the range, as parts
# of the way.
BEYOND = (1.0 / 3.0, 2.0 / 3.0)
# A limit is known well enough within this share of its distance from the present value.
NEAR = 0.1


@dataclass(frozen=True, slots=True)
class Rule:
    """Wald's sequential tests of a value, where f shows at `rate` at the present one: wrong with a
    chance of at most `error`.
    """

    rate: float
    error: float

    def verdict(self, outcomes: Sequence[str]) -> Verdict:
        """What the outcomes of runs 0, 1, ... show; "" while they do not decide. Runs beyond the
        decision do not change it.
        """
        f = goal = sound = 0
        shows: bool | None = None
        reached: bool | None = None
        for number, outcome in enumerate(outcomes, 1):
            # A broken run says nothing, and only counts against the patience.
            if outcome not in BROKEN:
                f = f + (outcome == "similar")
                goal = goal + (outcome == "pass")
                sound = sound + 1
                # Two claims may be wrong.
                error = self.error / 2.0
                if shows is None:
                    shows = leans_to(f, sound - f, SHOWS * self.rate, GONE * self.rate, error)
                if reached is None:
                    reached = leans_to(goal, sound - goal, REACHED, MISSED, error)
            if shows:
                return "f"
            if shows is False and reached is not None:
                if reached:
                    return "goal"
                return "other"
            if number >= MOST_RUNS:
                if shows is None:
                    return "undecided"
                return "other"
        return ""

    def surely_needed(self, outcomes: Sequence[str]) -> int:
        """How many more runs a value needs at least, whatever they show; 0 if it is decided."""
        alike = ("similar", "pass", "other")
        return next(
            more
            for more in count()
            if any(self.verdict([*outcomes, *[each] * more]) for each in alike)
        )


def error_each(rate: float, runs: int) -> float:
    """The error of each verdict, so that all that so many runs can give are right with a
    probability of at least 1 - `ERROR`.
    """
    fewest = 1
    while Rule(rate, ERROR / max(1, runs // (fewest + 1))).surely_needed(()) > fewest:
        fewest += 1
    return ERROR / max(1, runs // fewest)


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of a number's values: the outcomes of runs 0, 1, ..., how each failed, and why
    some are not possible.
    """

    outcomes: Mapping[float, Sequence[str]] = field(default_factory=dict)
    failures: Mapping[float, Sequence[str]] = field(default_factory=dict)
    impossible: Mapping[float, str] = field(default_factory=dict)

    def values(self, rule: Rule) -> list[Value]:
        """All values that were tried, the lowest first."""
        judged = [
            Value(
                value=value,
                verdict=rule.verdict(found),
                outcomes=tuple(found),
                failures=tuple(self.failures.get(value, ())),
            )
            for value, found in self.outcomes.items()
            if value not in self.impossible
        ]
        judged += [
            Value(value=value, verdict="impossible", why=why)
            for value, why in self.impossible.items()
        ]
        return sorted(judged, key=lambda one: one.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """A value that was tried, with the outcomes of its runs in their order and how each failed, or
    `why` it is not possible.
    """

    value: float
    verdict: Verdict
    outcomes: Names = ()
    failures: Names = ()
    why: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """The values tried above (`up`) or below the present one, the nearest first; `end` is where the
    range ends.

    `until`: the farthest up to which f shows at all values that were decided; None: the present
    one. `gone`: the nearest at which it does not show, or which is not possible. `goal`: the
    nearest at which the robot reaches its goal. `to_end`: it does at all values `beyond` it as
    well. `again`: the farthest at which f shows beyond `gone`.
    """

    up: bool
    tried: tuple[Value, ...]
    end: float
    until: Value | None = None
    gone: Value | None = None
    goal: Value | None = None
    again: Value | None = None
    to_end: bool = False


@dataclass(frozen=True, slots=True)
class Margin:
    """What is known of a number below and above its present value, by `runs` runs in all."""

    asked: NumberAsked
    down: Side
    up: Side
    runs: int

    @property
    def sides(self) -> tuple[Side, Side]:
        return self.down, self.up


def margin_of(asked: NumberAsked, rule: Rule, known: Known) -> Margin:
    """The margin of a number, by what is known of its values."""
    values = known.values(rule)
    down = [one for one in reversed(values) if one.value < asked.now]
    up = [one for one in values if one.value > asked.now]
    runs = sum(map(len, known.outcomes.values()))
    return Margin(asked, _side(asked, False, down), _side(asked, True, up), runs)


def _side(asked: NumberAsked, up: bool, tried: Sequence[Value]) -> Side:
    gone = next(
        (at for at, one in enumerate(tried) if one.verdict in ("goal", "other", "impossible")),
        len(tried),
    )
    shows = [[one for one in part if one.verdict == "f"] for part in (tried[:gone], tried[gone:])]
    until, again = (part[-1] if part else None for part in shows)
    side = Side(
        up=up,
        tried=tuple(tried),
        end=asked.high if up else asked.low,
        until=until,
        gone=None if gone == len(tried) else tried[gone],
    )
    first = next((at for at, one in enumerate(tried) if one.verdict == "goal"), None)
    if first is None:
        return replace(side, again=again)
    farther = {*beyond(asked, up, tried[first].value)}
    reached = all(one.verdict == "goal" for one in tried[first:])
    to_end = bool(farther) and reached and farther <= {one.value for one in tried}
    return replace(side, goal=tried[first], again=again, to_end=to_end)


def known_of(margins: Margins, name: str) -> Known:
    """What the runs of the search show of a number; a value's runs count up to the first that is
    not finished.
    """
    runs: dict[float, dict[int, tuple[str, str]]] = {}
    for one in margins.runs:
        if one.name == name and one.run < FIXES.start:
            runs.setdefault(one.value, {})[one.run] = one.outcome, one.failure
    finished = {
        value: [by[run] for run in takewhile(by.__contains__, count())]
        for value, by in runs.items()
    }
    return Known(
        {value: [outcome for outcome, _ in found] for value, found in finished.items()},
        {value: [how for _, how in found] for value, found in finished.items()},
        {one.value: one.why for one in margins.impossible if one.name == name},
    )


def margins_of(margins: Margins) -> tuple[Margin, ...]:
    """The margins of all numbers with a value that was tried, in the order in which they were asked
    for.
    """
    rules = ((one.asked, Rule(one.rate, one.error)) for one in margins.numbers)
    found = (margin_of(asked, rule, known_of(margins, asked.name)) for asked, rule in rules)
    return tuple(one for one in found if one.up.tried or one.down.tried)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """A changed number with which the robot reaches its goal, by runs of the search; `share` of the
    number's scale it is changed.

    Of `runs` fresh runs it `reached` its goal in so many; `confirmed` says whether they show it,
    None while they are not all made.
    """

    name: str
    value: float
    share: float
    reached: int
    runs: int
    confirmed: bool | None


def fixes_of(margins: Margins) -> tuple[Fix, ...]:
    """All values at which the robot reached its goal, the smallest change first."""
    fresh: dict[tuple[str, float], dict[int, bool]] = {}
    for run in margins.runs:
        if run.run >= FIXES.start:
            fresh.setdefault((run.name, run.value), {})[run.run] = run.outcome == "pass"
    found = []
    tried = (
        (one.asked, value)
        for one in margins_of(margins)
        for side in one.sides
        for value in side.tried
    )
    for asked, value in ((asked, one.value) for asked, one in tried if one.verdict == "goal"):
        made = fresh.get((asked.name, value), {})
        reached = sum(made.values())
        runs = len(made)
        # A run that broke counts against it.
        shown = leans_to(reached, runs - reached, REACHED, REACHED / 2.0, ERROR) is True
        share = abs(value - asked.now) / asked.scale
        found.append(
            Fix(
                name=asked.name,
                value=value,
                share=share,
                reached=reached,
                runs=runs,
                confirmed=shown if runs >= FIX_RUNS else None,
            )
        )
    return tuple(sorted(found, key=lambda one: (one.share, one.name)))


def pairs_of(margins: Margins) -> tuple[NumberAsked, ...]:
    """Two numbers to change together where no change of one was found to lead to the goal: the two
    with the nearest values at which something else happens than f, each towards the end of its
    range.
    """
    one_sided = [
        (one.asked, side, side.gone)
        for one in margins_of(margins)
        for side in one.sides
        if side.gone
    ]
    gone = [
        (asked, side, value)
        for asked, side, value in one_sided
        if value.verdict == "other" and not asked.together
    ]
    gone.sort(key=lambda each: abs(each[2].value - each[0].now) / each[0].scale)
    first = next(iter(gone), None)
    second = next((each for each in gone if first and each[0].name != first[0].name), None)
    if (
        first is None
        or second is None
        or any(fix.confirmed is not False for fix in fixes_of(margins)[:MOST_FIXES])
    ):
        return ()
    parts = tuple((asked.name, asked.now, side.end) for asked, side, _ in (first, second))
    return (
        NumberAsked(
            name=" & ".join(name for name, *_ in parts),
            now=0.0,
            low=0.0,
            high=100.0,
            scale=100.0,
            resolution=2.0,
            unit="%",
            together=parts,
        ),
    )


def changes_at(asked: NumberAsked, value: float) -> tuple[tuple[str, float], ...]:
    """The numbers that a value of `asked` means, with their values."""
    parts = (
        (name, float(f"{now + value / 100.0 * (end - now):.9g}"))
        for name, now, end in asked.together
    )
    return tuple(parts) or ((asked.name, value),)


def steps(asked: NumberAsked, up: bool) -> tuple[float, ...]:
    """The values outward from the present one to the end of the range; none if that is no farther
    than the resolution.
    """
    reach = asked.high - asked.now if up else asked.now - asked.low
    if reach <= 0.0:
        return ()
    if reach <= asked.resolution:
        return (asked.high if up else asked.low,)
    # A small number, such as the friction of ice, changes much by a small step.
    usual = FIRST_SHARE * reach
    first = min(
        reach,
        max(asked.resolution, min(usual, asked.now) if asked.low == 0.0 < asked.now else usual),
    )
    growth = (reach / first) ** (1.0 / (STEPS - 1))
    last = asked.high if up else asked.low
    if growth <= 1.0:
        return (last,)
    inner = (_at(asked, up, first * growth**step) for step in range(STEPS - 1))
    return (*dict.fromkeys(inner), last)


def _at(asked: NumberAsked, up: bool, distance: float, digits: int = 2) -> float:
    value = asked.now + math.copysign(float(f"{distance:.{digits}g}"), 1.0 if up else -1.0)
    return min(asked.high, max(asked.low, float(f"{value:.9g}")))


def beyond(asked: NumberAsked, up: bool, value: float) -> tuple[float, ...]:
    """Where the goal has to be reached, too, so that it is said to be reached from `value` on: at
    the end of the range, and at two values between.
    """
    end = asked.high if up else asked.low
    distance = abs(value - asked.now)
    left = abs(end - value)
    if left <= asked.resolution:
        return ()
    return end, *(_at(asked, up, distance + part * left, digits=3) for part in BEYOND)


def next_value(asked: NumberAsked, up: bool, tried: Collection[Value]) -> float | None:
    """The next value to try on one side, after those `tried` there, of which one may be open; None
    if enough is known.
    """
    by_value = {one.value: one for one in tried}
    if (open_one := next((one.value for one in tried if not one.verdict), None)) is not None:
        return open_one
    for value in steps(asked, up):
        if value not in by_value:
            return value
        if by_value[value].verdict in ("goal", "impossible"):
            break
    near = sorted(tried, key=lambda one: abs(one.value - asked.now))
    # Between the nearest one where f is gone, or where the goal is reached, and the one before it,
    # until that is near enough.
    for limit in (("goal", "other", "impossible"), ("goal",)):
        place = next((place for place, one in enumerate(near) if one.verdict in limit), None)
        if place is None or (place and near[place - 1].verdict == "undecided"):
            continue
        high = abs(near[place].value - asked.now)
        low = abs(near[place - 1].value - asked.now) if place else 0.0
        # Far apart, the middle is that of their ratio.
        middle = _at(
            asked,
            up,
            math.sqrt(low * high) if low > 0.0 and high > 2.0 * low else (low + high) / 2.0,
        )
        if high - low > max(asked.resolution, NEAR * high) and middle not in by_value:
            return middle
    goal = next((one.value for one in near if one.verdict == "goal"), None)
    farther = () if goal is None else beyond(asked, up, goal)
    to_try = (
        value for value in farther if value not in by_value or by_value[value].verdict != "goal"
    )
    first = next(to_try, None)
    if first in by_value:
        return None
    return first


def wanted(
    asked: NumberAsked, rule: Rule, known: Known, most: int = MOST_OF_NUMBER
) -> Iterator[tuple[float, int]]:
    """The runs that are surely needed next, as (value, run), with at most `most` runs in all; none
    when the search is over.
    """
    sides = margin_of(asked, rule, known).sides
    lengths = [len(steps(asked, side.up)) for side in sides]
    for side, length in zip(sides, lengths, strict=True):
        value = next_value(asked, side.up, side.tried)
        if value is None:
            continue
        made = known.outcomes.get(value, ())
        more = rule.surely_needed(made)
        # Each side has its part, so that no race of tests decides which one gets the last runs.
        # Where they may run out before this value is decided, one run after the other says whether
        # more are needed.
        left = most * length // sum(lengths) - sum(len(one.outcomes) for one in side.tried)
        if more <= left:
            yield from (
                (value, len(made) + run)
                for run in range(more if MOST_RUNS - len(made) <= left else 1)
            )
