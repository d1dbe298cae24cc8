"""Which method is best where: the tests of each in each scenario, beside the least that any could need."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ddenv.page.blocks import Block, Cell, Section, Strong, Table, plain, say
from ddenv.study.plan import Method
from ddenv.study.rows import Group, Row, least_of, least_to_find, least_to_show
from ddenv.words import count

# A comparison needs some methods; without it, the tables tell all.
FEWEST = 4


def best(groups: Sequence[Group]) -> Section | None:
    """All methods, those that needed the fewest tests first; None where few were tried."""
    methods = [row.method for row in groups[0].rows]
    if len(methods) < FEWEST or not any(group.minimal for group in groups):
        return None
    ranked = sorted(zip(methods, zip(*(group.rows for group in groups), strict=True), strict=True), key=_rank)
    least = [min((row.tests for row in group.rows if row.tests is not None), default=None) for group in groups]
    rows = [_row(method, rows, least) for method, rows in ranked]
    shown, likely = (tuple(_bound(group, bound) for group in groups) for bound in (least_to_show, least_to_find))
    head = ("method", *(f"{plain(group.scenario.name)}, tests" for group in groups), "times the bound, mean")
    bounds = (
        ("least to show that the end is minimal", *shown, "1.0"),
        ("least to find it, if all is as likely", *likely, "–"),
    )
    table = Table(head, (*bounds, *rows), frozenset(range(1, len(head))))
    return Section("Which is best where", (*_words(groups), table, _about_the_bound()))


def _rank(entry: tuple[Method, tuple[Row, ...]]) -> tuple[bool, float]:
    """By the mean of how many times the bound they took; what is not minimal everywhere comes last."""
    times = _times(entry[1])
    return times is None, times or 0.0


def _times(rows: Sequence[Row]) -> float | None:
    """The geometric mean, in which a scenario counts as much as another one however many tests it takes."""
    ratios = [row.tests / row.bound for row in rows if row.tests is not None and row.bound]
    if len(ratios) < len(rows):
        return None
    return math.exp(sum(map(math.log, ratios)) / len(ratios))


def _row(method: Method, rows: Sequence[Row], least: Sequence[float | None]) -> tuple[Cell, ...]:
    times = _times(rows)
    cells = tuple(_cell(row, fewest) for row, fewest in zip(rows, least, strict=True))
    return method.label, *cells, "–" if times is None else f"{times:.1f}"


def _cell(row: Row, fewest: float | None) -> Cell:
    if row.tests is None:
        return "not minimal" if any(each.elements for each in row.found) else "not made yet"
    said = f"{row.tests:g}"
    said = said if len(row.minimal) == len(row.found) else f"{said} ({len(row.minimal)} of {len(row.found)} seeds)"
    return Strong(f"{said} ◂") if row.tests == fewest else said


def _bound(group: Group, bound: Callable[[int, int, int, int], int]) -> str:
    """It depends on how many models are left, and so on the cell: the range."""
    bounds = sorted({least_of(each, bound) for each in group.minimal})
    if not bounds:
        return "–"
    return str(bounds[0]) if len(bounds) == 1 else f"{bounds[0]} to {bounds[-1]}"


def _words(groups: Sequence[Group]) -> list[Block]:
    told = []
    for group in groups:
        rows = [row for row in group.rows if row.tests is not None]
        if rows:
            first, last = min(rows, key=lambda row: row.tests), max(rows, key=lambda row: row.tests)
            equal = sum(row.tests == first.tests for row in rows) - 1
            also = f" and {count(equal, 'other')}" if equal else ""
            words = f": {first.method.label}{also} with {first.tests:g} tests; the most takes {last.method.label}, {last.tests:g}."
            told.append(say(Strong(plain(group.scenario.name)), words))
    return told


def _about_the_bound() -> Block:
    return say(
        "Ranked by how many times the first bound they took (geometric mean over the scenarios). No method needs less than that: "
        "after the baseline f has to show in what is left, and each of its models has to be left out in vain, with all re-runs. "
        "The second bound is for methods that know nothing: what it takes on average to tell which set of so many models it is, "
        "if each is as likely. Who tries first what is near the failure may need less. A mark (◂) is on the fewest."
    )
