"""Margins in words: a table of numbers, a sentence for each, the nearest fix, and how far the search is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from ddenv.evidence.margins import (
    ERROR,
    FIRST_FIX_RUN,
    FIX_RUNS,
    MOST_OF_NUMBER,
    Fix,
    Margin,
    Side,
    Value,
    fixes_of,
    known_of,
    margins_of,
    rule_of,
)
from ddenv.evidence.rates import anytime_interval
from ddenv.runfile.events import deed
from ddenv.runfile.progress import Margins
from ddenv.runfile.state import RunState
from ddenv.text import count, duration, percent

FINDING = "finding margins"
HEAD = ("number", "now", "f until", "goal from", "runs")
# How many times the runs of a first look at all numbers both looks take, about.
SECOND_LOOK = 1.4


def figure(value: float) -> str:
    """A value in few digits."""
    return f"{value + 0.0:.4g}"


@dataclass(frozen=True, slots=True)
class Row:
    """A number in the table: `HEAD`, with the values below the present one before those above it; and a sentence."""

    name: str
    cells: tuple[str, ...]
    sentence: str
    margin: Margin


def rows(margins: Margins) -> tuple[Row, ...]:
    """The table of all numbers that were looked at."""
    return tuple(_row(one) for one in margins_of(margins))


def _row(one: Margin) -> Row:
    asked = one.asked
    until = " … ".join(_until(side) for side in one.sides if side.tried) or "-"
    goals = [words for side in one.sides if (words := _goal(side))]
    cells = (asked.name, _with_unit(one, asked.now), until, ", ".join(goals) or "-", str(one.runs))
    said = "; ".join(_side(one, side) for side in one.sides if side.tried)
    return Row(asked.name, cells, f"{asked.name} ({_with_unit(one, asked.now)}): {said}", one)


def _with_unit(one: Margin, value: float) -> str:
    return f"{figure(value)} {one.asked.unit}".rstrip()


def _until(side: Side) -> str:
    """Where f still shows; "all" if it does up to the end of the range."""
    if side.gone is None:
        return (
            f"{figure(side.until.value)} (all)"
            if side.until is not None and side.until.value == side.end
            else _value(side)
        )
    return _value(side)


def _value(side: Side) -> str:
    return "now" if side.until is None else figure(side.until.value)


def _goal(side: Side) -> str:
    """From where the robot reaches its goal, else what happens where f no longer shows; "" if neither is known."""
    sign = "≥" if side.up else "≤"
    if side.goal is not None:
        return f"{sign} {figure(side.goal.value)}"
    if side.gone is None or side.gone.verdict != "other":
        return ""
    failed = (how for how, outcome in zip(side.gone.failures, side.gone.outcomes, strict=True) if outcome == "other")
    most = Counter(failed).most_common(1)
    return f"{most[0][0] if most else 'f at times'} {sign} {figure(side.gone.value)}"


def _instead(value: Value) -> str:
    """What happened in runs that did not show f: "lost in 5, goal in 1"."""
    happened = Counter(
        "goal" if outcome == "pass" else deed(failure) for outcome, failure in zip(value.outcomes, value.failures, strict=True)
        if outcome in ("pass", "other")
    )  # fmt: skip
    return ", ".join(f"{what} in {runs}" for what, runs in happened.most_common())


def _runs(shown: int, value: Value) -> str:
    return f"{shown} of {count(len(value.outcomes), 'run')}"


def _side(one: Margin, side: Side) -> str:
    """What the values on one side show: only of these."""
    way = "up to" if side.up else "down to"
    words = []
    if side.until is not None:
        words.append(f"f {way} {figure(side.until.value)} ({_runs(side.until.shown, side.until)})")
    gone = side.gone
    if gone is None:
        if side.until is not None and side.until.value == side.end:
            words.append("which is as far as was tried")
    elif gone.verdict == "impossible":
        words.append(f"{figure(gone.value)} is not possible: {gone.why}")
    elif gone.verdict == "other":
        words.append(f"at {figure(gone.value)} f in {_runs(gone.shown, gone)}, {_instead(gone)} instead")
    if side.goal is not None:
        words.append(f"the robot reaches its goal {'from' if side.up else 'at'} {figure(side.goal.value)} "
                     f"({_runs(side.goal.reached, side.goal)})")  # fmt: skip
    if side.again is not None:
        words.append(f"f again at {figure(side.again.value)} ({_runs(side.again.shown, side.again)})")
    undecided = [figure(each.value) for each in side.tried if each.verdict in ("undecided", "")]
    if undecided:
        words.append(f"undecided at {', '.join(undecided)}")
    return ", ".join(words)


def nearest_fix(margins: Margins) -> str:
    """The smallest change with which the robot reaches its goal, in a sentence without a full stop; "" while there is none."""
    fixes = fixes_of(margins)
    judged = [one for one in fixes if one.confirmed is not None]
    if not judged:
        return ""
    last = next((one for one in judged if one.confirmed), judged[-1])
    asked = next(one.asked for one in margins.numbers if one.asked.name == last.name)
    low, high = anytime_interval(last.reached, last.runs)
    change = f"{last.name} from {figure(asked.now)} to {figure(last.value)}, {_share(last)} of its scale"
    fresh = f"in {last.reached} of {count(last.runs, 'fresh run')} ({percent(low)} to {percent(high)})"
    if last.confirmed:
        return f"the nearest fix: {change}; the robot reaches its goal {fresh}"
    return f"no fix is certified: with {change}, the robot reaches its goal only {fresh}"


def _share(fix: Fix) -> str:
    return f"{100.0 * fix.share:.2g} %"


def sureness(margins: Margins) -> str:
    """What the table's claims are worth, in a sentence."""
    least = "" if margins.certified else " No certificate has shown yet how often f shows in what is left."
    return (
        f"Claims are about the values that were tried, not those between; the chance that any of one call is wrong is at most "
        f"{percent(ERROR)}.{least}"
    )


def finding(state: RunState) -> str:
    """How far the search for margins is: which number it looks at, its runs, and about how long it takes."""
    now = state.margining
    if now is None:
        return FINDING
    runs = now.runs[now.before_call :]
    name = runs[-1].name if runs else now.wanted[0]
    return f"{FINDING}: {name}, {len(runs)} of at most {count(_most(now) + FIX_RUNS, 'run')}{_left(state, now)}"


def _most(now: Margins) -> int:
    """How many runs the numbers may take."""
    return min(now.budget, MOST_OF_NUMBER * len(now.wanted))


def _left(state: RunState, now: Margins) -> str:
    """A forecast, from the runs that the numbers took so far."""
    runs = now.runs[now.before_call :]
    if not runs:
        return ""
    if runs[-1].run >= FIRST_FIX_RUN:
        left = max(1, FIX_RUNS - sum(one.run >= FIRST_FIX_RUN for one in runs) % FIX_RUNS)
    else:
        # Numbers that were looked at once leave runs to the second look.
        made = len({one.name for one in runs})
        left = _most(now) if made < len(now.wanted) else round(len(runs) / made * len(now.wanted) * SECOND_LOOK)
        left = min(_most(now), max(len(runs), left)) - len(runs) + FIX_RUNS
    seconds = sum(one.wall_seconds for one in runs) / len(runs) * max(1, left) / max(1, state.jobs)
    return f", about {duration(seconds)} left"


def ran(before: RunState, after: RunState) -> str:
    """The line on a run: what it decides about its value; "" while that is open."""
    assert after.margins is not None
    last = after.margins.runs[-1]
    if last.run >= FIRST_FIX_RUN:
        fix = next((one for one in fixes_of(after.margins) if (one.name, one.value) == (last.name, last.value)), None)
        return "" if fix is None or fix.confirmed is None else f"  {nearest_fix(after.margins)}"
    tried = next(one for one in after.margins.numbers if one.asked.name == last.name)
    known = known_of(after.margins, last.name)
    outcomes, failures = known.outcomes[last.value], known.failures[last.value]
    verdict = rule_of(tried).verdict(outcomes)
    if not verdict:
        return ""
    value = Value(last.value, verdict, tuple(outcomes), tuple(failures))
    shown = f"f in {_runs(value.shown, value)}"
    instead = _instead(value)
    return f"  {last.name} = {figure(last.value)}: {shown}{f' ({instead})' if instead else ''}; {finding(after).partition(', ')[2]}"


def impossible(_: RunState, after: RunState) -> str:
    """The line on a value that is not possible."""
    assert after.margins is not None
    last = after.margins.impossible[-1]
    return f"  {last.name} = {figure(last.value)}: not possible: {last.why}"


def started(_: RunState, after: RunState) -> str:
    """The line on the beginning."""
    assert after.margins is not None
    now = after.margins
    return (
        f"{FINDING} of {count(len(now.wanted), 'number')}: how far each may change before f goes; at most "
        f"{count(_most(now), 'run')}, and {FIX_RUNS} of the nearest fix"
    )


# What a bar shows: the change as a share of the number's scale, drawn as its root, so that small ones are seen.
BAR_WORDS = (
    "█ f shows   + the robot reaches its goal   · something else, or undecided   x not possible; between two values that were "
    "tried: like the one farther out. Left and right: change as a share of the number's scale."
)
_SIGNS = {"f": "█", "goal": "+", "other": "·", "undecided": "·", "impossible": "x", "": "·"}


def bar_scale(width: int) -> str:
    """The scale above bars of so many cells: 1 %, 10 % and 100 % on both sides of the present value."""
    cells = [" "] * width
    for share, mark in ((0.01, "1"), (0.1, "10"), (1.0, "100 %")):
        for sign in (-1, 1):
            at = min(width - len(mark), max(0, round((width - 1) / 2 * (1 + sign * share**0.5) - (len(mark) - 1) / 2)))
            cells[at : at + len(mark)] = mark
    cells[width // 2] = "0"
    return "".join(cells)


def bar(one: Margin, width: int) -> str:
    """A line of so many cells around the present value, up to the farthest one that was tried on each side."""
    cells = []
    for place in range(width):
        at = 2.0 * place / (width - 1) - 1.0
        side = one.sides[at > 0.0]
        change = at * at * one.asked.scale
        beyond = (each for each in side.tried if abs(each.value - one.asked.now) >= 0.999 * change)
        cells.append(_SIGNS[each.verdict] if (each := next(beyond, None)) else " ")
    cells[width // 2] = "|"
    return "".join(cells)


def lines(margins: Margins) -> Iterable[str]:
    """The table as lines of text, with a sentence for each number and for the nearest fix."""
    table = [HEAD, *(one.cells for one in rows(margins))]
    widths = [max(len(row[column]) for row in table) for column in range(len(HEAD))]
    for row in table:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
    yield ""
    yield from (f"- {one.sentence}" for one in rows(margins))
    if fix := nearest_fix(margins):
        yield f"{fix[:1].upper()}{fix[1:]}."
    yield sureness(margins)
