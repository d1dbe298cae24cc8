"""Margins: how far a number may change before f goes, and from where the robot reaches its goal.

From the present value outward by growing steps, up and down, then by halves between values with other verdicts. All follows from
what is known of the values, so a search that was interrupted goes on as it would have.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from ddenv.evidence.margins import MOST_OF_NUMBER, Known, Rule, Value, margin_of
from ddenv.runfile.events import NumberAsked

# The outward steps to the end of the range, the first of them as a share of it.
STEPS, FIRST_SHARE = 3, 1.0 / 16.0
# A limit is known well enough within this share of its distance from the present value.
NEAR = 0.1


def steps(asked: NumberAsked, up: bool) -> tuple[float, ...]:
    """The values outward from the present one to the end of the range; none if that is no farther than the resolution."""
    reach = asked.high - asked.now if up else asked.now - asked.low
    if reach <= 0.0:
        return ()
    if reach <= asked.resolution:
        return (asked.high if up else asked.low,)
    # A small number, such as the friction of ice, changes much by a small step.
    usual = FIRST_SHARE * reach
    first = min(reach, max(asked.resolution, min(usual, asked.now) if asked.low == 0.0 < asked.now else usual))
    growth = (reach / first) ** (1.0 / (STEPS - 1))
    inner = (_at(asked, up, first * growth**step) for step in range(STEPS - 1)) if growth > 1.0 else ()
    return (*dict.fromkeys(inner), asked.high if up else asked.low)


def _at(asked: NumberAsked, up: bool, distance: float) -> float:
    """The value at this distance, in few digits."""
    value = asked.now + math.copysign(float(f"{distance:.2g}"), 1.0 if up else -1.0)
    return min(asked.high, max(asked.low, float(f"{value:.9g}")))


def next_value(asked: NumberAsked, up: bool, tried: Collection[Value]) -> float | None:
    """The next value to try on one side, after those `tried` there, of which one may be open; None if enough is known."""
    by_value = {one.value: one for one in tried}
    if (open_one := next((one.value for one in tried if not one.verdict), None)) is not None:
        return open_one
    for value in steps(asked, up):
        if value not in by_value:
            return value
        if by_value[value].verdict in ("goal", "impossible"):
            break
    near = sorted(tried, key=lambda one: abs(one.value - asked.now))
    return next(
        filter(None, (_between(asked, up, near, limit) for limit in (("goal", "other", "impossible"), ("goal",)))), None
    )


def _between(asked: NumberAsked, up: bool, near: list[Value], limit: tuple[str, ...]) -> float | None:
    """A value between the nearest one whose verdict is in `limit` and the one before it; None if that is near enough.

    `near` has the values that were tried, the nearest to the present one first.
    """
    place = next((place for place, one in enumerate(near) if one.verdict in limit), None)
    if place is None or (place and near[place - 1].verdict == "undecided"):
        return None
    high = abs(near[place].value - asked.now)
    low = abs(near[place - 1].value - asked.now) if place else 0.0
    if high - low <= max(asked.resolution, NEAR * high):
        return None
    # Far apart, the middle is that of their ratio.
    middle = _at(asked, up, math.sqrt(low * high) if low > 0.0 and high > 2.0 * low else (low + high) / 2.0)
    return None if any(one.value == middle for one in near) else middle


def wanted(asked: NumberAsked, rule: Rule, known: Known, most: int = MOST_OF_NUMBER) -> Iterator[tuple[float, int]]:
    """The runs that are surely needed next, as (value, run), with at most `most` runs in all; none when the search is over."""
    sides = margin_of(asked, rule, known).sides
    lengths = [len(steps(asked, side.up)) for side in sides]
    for side, length in zip(sides, lengths, strict=True):
        value = next_value(asked, side.up, side.tried)
        if value is None:
            continue
        made = known.outcomes.get(value, ())
        more = rule.surely_needed(made)
        # Each side has its part, so that no race of tests decides which one gets the last runs.
        if sum(len(one.outcomes) for one in side.tried) + more <= most * length // sum(lengths):
            yield from ((value, len(made) + run) for run in range(more))
