"""Margins in words: a table of numbers, a sentence for each, the nearest fix, and how far the
search is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from ddenv.evidence.margins import (
    ERROR,
    FIX_RUNS,
    MOST_OF_NUMBER,
    Margin,
    Side,
    Value,
    changes_at,
    fixes_of,
    margins_of,
)
from ddenv.evidence.rates import anytime_interval
from ddenv.run_numbers import FIXES
from ddenv.runfile.failure_words import deed
from ddenv.runfile.progress import Margins
from ddenv.runfile.state import RunState
from ddenv.text import count, duration, percent

FINDING = "finding margins"
HEAD = ("number", "now", "f until", "instead", "runs")
# What a bar shows. It is drawn over the root of the change, so that small changes are seen.
BAR_WORDS = (
    "█ f, + goal, · something else or undecided, x not possible; between two values tried: as at "
    "the farther one. "
    "From the middle outwards: the change as a share of the number's scale, on a square-root "
    "axis; half way is 25 %."
)
_SIGNS = {"f": "█", "goal": "+", "impossible": "x"}


@dataclass(frozen=True, slots=True)
class Row:
    """A number in the table: the cells below `HEAD`, those for lower values first; and a sentence
    without a full stop.
    """

    cells: tuple[str, ...]
    sentence: str
    margin: Margin


def rows(margins: Margins) -> tuple[Row, ...]:
    """The table of all numbers that were looked at."""
    found = []
    for one in margins_of(margins):
        name = one.asked.name
        now = f"{one.asked.now:.4g} {one.asked.unit}".rstrip()
        sides = [side for side in one.sides if side.tried]
        until = " … ".join(
            "now" if side.until is None else f"{side.until.value:.4g}{_end(side)}" for side in sides
        )
        instead = ", ".join(words for side in sides if (words := _from(side)))
        sentence = f"{name} ({now}): {'; '.join(_said(side) for side in sides)}"
        found.append(Row((name, now, until, instead or "-", str(one.runs)), sentence, one))
    return tuple(found)


def _end(side: Side) -> str:
    if side.gone is None and side.until is not None and side.until.value == side.end:
        return " (end)"
    return ""


def _from(side: Side) -> str:
    """Where the robot reaches its goal, else what happens where f no longer shows; "" if neither is
    known.
    """
    if side.goal is not None:
        to_end = "≥" if side.up else "≤"
        return f"goal {to_end if side.to_end else 'at'} {side.goal.value:.4g}"
    if side.gone is None or side.gone.verdict != "other":
        return ""
    failed = [
        how
        for how, outcome in zip(side.gone.failures, side.gone.outcomes, strict=True)
        if outcome == "other"
    ]
    return f"{max(failed, key=failed.count, default='f at times')} at {side.gone.value:.4g}"


def _said(side: Side) -> str:
    words = []
    if side.until is not None:
        all_of_them = ", the end of its range" if _end(side) else ""
        words.append(
            f"f {'up' if side.up else 'down'} to {_in(side.until, 'similar')}{all_of_them}"
        )
    if side.gone is not None and side.gone.verdict == "impossible":
        words.append(f"{side.gone.value:.4g} is not possible: {side.gone.why}")
    elif side.gone is not None and side.gone.verdict == "other":
        words.append(f"no f at {_in(side.gone, 'similar')}, where the robot {_instead(side.gone)}")
    if side.goal is not None:
        if side.to_end:
            to_end = f", and beyond at all values tried, to the end of its range ({side.end:.4g})"
        else:
            to_end = ""
        words.append(f"the robot reaches its goal at {_in(side.goal, 'pass')}{to_end}")
    if side.again is not None:
        words.append(f"f again at {_in(side.again, 'similar')}")
    if undecided := [
        f"{each.value:.4g}" for each in side.tried if each.verdict in ("undecided", "")
    ]:
        words.append(f"undecided at {', '.join(undecided)}")
    return ", ".join(words)


def _in(value: Value, outcome: str) -> str:
    return (
        f"{value.value:.4g} ({value.outcomes.count(outcome)} of "
        f"{count(len(value.outcomes), 'run')})"
    )


def _instead(value: Value) -> str:
    """What happened in runs that did not show f: "was lost in 5, reached its goal in 1"."""
    ends = zip(value.outcomes, value.failures, strict=True)
    happened = Counter(
        "reached its goal" if end == "pass" else deed(how)
        for end, how in ends
        if end in ("pass", "other")
    )
    return ", ".join(f"{what} in {runs}" for what, runs in happened.most_common())


def nearest_fix(margins: Margins) -> str:
    """The smallest change with which the robot reaches its goal, as a sentence; "" while there is
    none.
    """
    judged = [one for one in fixes_of(margins) if one.confirmed is not None]
    if not judged:
        return ""
    one = next((one for one in judged if one.confirmed), judged[-1])
    asked = next(each.asked for each in margins.numbers if each.asked.name == one.name)
    low, high = anytime_interval(one.reached, one.runs)
    now = {name: now for name, now, _ in asked.together} or {asked.name: asked.now}
    change = " and ".join(
        f"{name} from {now[name]:.4g} to {to:.4g}" for name, to in changes_at(asked, one.value)
    )
    change += (
        f", {100.0 * one.share:.2g} % of its scale"
        if not asked.together
        else f", {one.value:.2g} % of their ranges"
    )
    only, first = (
        ("", "The nearest fix found") if one.confirmed else (" only", "No fix is certified")
    )
    fresh = (
        f"in {one.reached} of {count(one.runs, 'fresh run')} ({percent(low)} to {percent(high)})"
    )
    return f"{first}: {change}; the robot reaches its goal{only} {fresh}."


def sureness(margins: Margins) -> str:
    if margins.asked.certified:
        less = ""
    else:
        less = " No certificate has shown yet how often f shows in what is left."
    return (
        "Claims hold for the values tried, not for those in between; the chance that any claim "
        "of a call is wrong is at most "
        f"{percent(ERROR)}.{less}"
    )


def said(margins: Margins) -> list[str]:
    """All sentences: the nearest fix, each number, and what that is worth."""
    return [
        *filter(None, [nearest_fix(margins)]),
        *(f"{one.sentence}." for one in rows(margins)),
        sureness(margins),
    ]


def lines(margins: Margins) -> Iterator[str]:
    table = [HEAD, *(one.cells for one in rows(margins))]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
    yield from ("", *said(margins))


def bar(one: Margin, width: int) -> str:
    """A line of so many cells around the present value, up to the farthest one that was tried on
    each side.
    """
    cells = []
    for place in range(width):
        at = 2.0 * place / (width - 1) - 1.0
        change = at * at * one.asked.scale
        beyond = (
            each
            for each in one.sides[at > 0.0].tried
            if abs(each.value - one.asked.now) >= 0.999 * change
        )
        cells.append(" " if (each := next(beyond, None)) is None else _SIGNS.get(each.verdict, "·"))
    cells[width // 2] = "|"
    return "".join(cells)


# While the search goes on.


def finding(state: RunState) -> str:
    """How far the search for margins is: its number, its runs, and about how long it takes by the
    runs so far.
    """
    now = state.margining
    if now is None:
        return FINDING
    runs = now.runs[now.before_call :]
    most = min(now.asked.budget, MOST_OF_NUMBER * len(now.wanted)) + FIX_RUNS
    if not runs:
        return f"{FINDING}: at most {count(most, 'run')}"
    left = most - len(runs)
    if runs[-1].run >= FIXES.start:
        left = -sum(one.run >= FIXES.start for one in runs) % FIX_RUNS
    seconds = sum(one.wall_seconds for one in runs) / len(runs) * left / max(1, state.jobs)
    done = f"{len(runs)} of at most {count(most, 'run')}"
    return f"{FINDING}: {runs[-1].name}, {done}, at most about {duration(seconds)} left"


def ran(_: RunState, after: RunState) -> str:
    """The line on a run: what it decides about its value; "" while that is open."""
    assert after.margins is not None
    last = after.margins.runs[-1]
    if last.run >= FIXES.start:
        fixes = {(one.name, one.value): one for one in fixes_of(after.margins)}
        known = fixes.get((last.name, last.value))
        if known is None or known.confirmed is None:
            return ""
        return f"  {nearest_fix(after.margins)}"
    one = next(one for one in margins_of(after.margins) if one.asked.name == last.name)
    value = next(each for side in one.sides for each in side.tried if each.value == last.value)
    if not value.verdict:
        return ""
    instead = f"; {_instead(value)}" if _instead(value) else ""
    shown = (
        f"f in {value.outcomes.count('similar')} of {count(len(value.outcomes), 'run')}{instead}"
    )
    return f"  {last.name} = {last.value:.4g}: {shown} · {finding(after).partition(', ')[2]}"


def impossible(_: RunState, after: RunState) -> str:
    assert after.margins is not None
    last = after.margins.impossible[-1]
    return f"  {last.name} = {last.value:.4g}: not possible: {last.why}"


def started(_: RunState, after: RunState) -> str:
    assert after.margins is not None
    return (
        f"{finding(after)}; how far can each of {count(len(after.margins.wanted), 'number')} "
        "change before f disappears?"
    )
