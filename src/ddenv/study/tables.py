"""The tables of a study: which method is best where, and for each scenario our numbers beside the paper's."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ddenv.page.blocks import Block, Cell, Name, Paragraph, Part, Picture, Section, Strong, Table, percent, plain, say
from ddenv.study.figures import chart, worlds
from ddenv.study.plan import Method, file_name
from ddenv.study.results import Found
from ddenv.study.rows import TABLES, Group, Row, least_of, least_to_find, least_to_show, spread, theirs
from ddenv.words import count

# The maximum number of models that are named.
MOST_NAMES = 8
# With more methods than this, the details are not a table but a sentence for each set of models that is left.
MOST_ROWS = 12
# The maximum number of cells with the same problem that are named.
MOST_CELLS = 3


def section(folder: Path, group: Group) -> Section:
    """The section on one scenario."""
    name = plain(group.scenario.name)
    number = TABLES.get(name)
    models = f", {count(group.models, 'model')}" if group.models else ""
    title = f"{name}{models}" + (f" (Table {number} of the paper)" if number and _has_theirs(group) else "")
    blocks: list[Block] = [say(plain(group.scenario.description))] if group.scenario.description else []
    blocks.append(numbers(group))
    blocks += _problems(group)
    if group.minimal:
        blocks += [behind(group)] if len(group.rows) <= MOST_ROWS else _in_short(group)
        title = "Models left after each test, a line for each method (the paper's Figure 2):"
        blocks += [say(title), Picture(f"figure-2-{file_name(group.scenario)}", chart(group), title)]
    blocks += worlds(folder, group, file_name(group.scenario))
    return Section(title, tuple(blocks))


def numbers(group: Group) -> Table:
    """Tests, reduction and minutes, beside the paper's if it has them."""
    beside = _has_theirs(group)
    head: tuple[str, ...] = ("partitioning, prioritization", "tests", "% reduction", "minutes")
    if beside:
        head = (head[0], "tests", "paper", "% reduction", "paper", "minutes", "paper")
    rows = tuple(_numbers(row, beside) for row in group.rows)
    return Table(head, rows, frozenset(range(1, len(head))))


def _numbers(row: Row, beside: bool) -> tuple[Cell, ...]:
    minimal = row.minimal
    tests = spread([each.tests for each in minimal], _whole)
    smaller = spread([each.smaller for each in minimal], percent)
    minutes = spread([each.seconds / 60 for each in minimal], _minutes)
    if not beside:
        return row.method.label, tests, smaller, minutes
    paper = theirs(row.found[0].cell)
    beside_it = ("–", "–", "–") if paper is None else (str(paper.tests), percent(paper.smaller), str(paper.minutes))
    return row.method.label, tests, beside_it[0], smaller, beside_it[1], minutes, beside_it[2]


def _whole(value: float) -> str:
    return f"{value:.0f}" if value == int(value) else f"{value:.1f}"


def _minutes(value: float) -> str:
    return f"{value:.1f}"


def _has_theirs(group: Group) -> bool:
    return any(theirs(row.found[0].cell) is not None for row in group.rows)


def behind(group: Group) -> Table:
    """Details: re-runs, how often the whole world fails, what is left, and the check of it."""
    head = ("method", "re-runs", "f in the whole world", "models left", "left out once more", "least tests")
    return Table(head, tuple(_behind(row) for row in group.rows), frozenset({1, 2, 5}))


def _in_short(group: Group) -> Iterator[Paragraph]:
    """The details of many methods, a sentence for each set of models that is left."""
    sets: dict[tuple[str, ...], list[Found]] = {}
    for each in group.minimal:
        sets.setdefault(each.left, []).append(each)
    for left, cells in sets.items():
        reruns = spread([each.reruns / each.tests for each in cells], percent)
        words = f" are left in {len(cells)} of {count(len(group.minimal), 'cell')}; re-runs {reruns} of the tests; "
        yield say(*_names(left), f"{words}left out once more: {_again(tuple(cells))}.")


def _behind(row: Row) -> tuple[Cell, ...]:
    minimal = row.minimal
    reruns = spread([each.reruns / each.tests for each in minimal if each.tests], percent)
    bound = "–" if row.bound is None else f"{row.bound:g}"
    return row.method.label, reruns, _rate(row), _left(minimal), _again(minimal), bound


def _rate(row: Row) -> str:
    runs = sum(each.baseline.runs for each in row.found if each.baseline)
    return f"{sum(each.baseline.failures for each in row.found if each.baseline)} of {runs}" if runs else "–"


def _left(minimal: tuple[Found, ...]) -> Cell:
    """Each set of models that is left, the most frequent first."""
    if not minimal:
        return "–"
    sets = Counter(each.left for each in minimal)
    words: list[Part] = []
    for left, times in sets.most_common():
        words += ["; " if words else "", *_names(left)]
        words += [f" ({times} of {len(minimal)})"] if len(sets) > 1 else []
    return tuple(words)


def _names(left: tuple[str, ...]) -> Iterator[Part]:
    if not left:
        yield "none"
    for number, name in enumerate(left[:MOST_NAMES]):
        yield ", " if number else ""
        yield Name(name)
    if len(left) > MOST_NAMES:
        yield f" and {len(left) - MOST_NAMES} more"


def _again(minimal: tuple[Found, ...]) -> str:
    """How often f shows with new seeds: with all that is left, and without each model."""
    checks = [each.check for each in minimal if each.check is not None]
    if not checks:
        return "–"
    shown, runs = sum(check.shown for check in checks), sum(check.runs for check in checks)
    without = sum(sum(check.without.values()) for check in checks)
    of_them = sum(check.runs * len(check.without) for check in checks)
    return f"f in {without} of {of_them}; with all in {shown} of {runs}"


def _problems(group: Group) -> Iterator[Paragraph]:
    """The cells without a minimal environment, and why."""
    cells: dict[str, list[str]] = {}
    for row in group.rows:
        for each in row.found:
            if problem := plain(each.trouble).rstrip("."):
                cells.setdefault(problem, []).append(f"{row.method.label}, seed {each.cell.seed}")
    for problem, names in cells.items():
        which = "; ".join(names) if len(names) <= MOST_CELLS else count(len(names), "cell")
        yield say(f"{which}: {problem}.", notice=True)


# A comparison needs at least this many methods.
FEWEST = 4


def best(groups: Sequence[Group]) -> Section | None:
    """All methods, the fewest tests first; None if too few were tried."""
    methods = [row.method for row in groups[0].rows]
    if len(methods) < FEWEST or not any(group.minimal for group in groups):
        return None
    ranked = sorted(zip(methods, zip(*(group.rows for group in groups), strict=True), strict=True), key=_rank)
    least = [min((row.tests for row in group.rows if row.tests is not None), default=None) for group in groups]
    rows = [_row(method, rows, least) for method, rows in ranked]
    shown, likely = (tuple(_bound(group, bound) for group in groups) for bound in (least_to_show, least_to_find))
    head = ("method", *(f"{plain(group.scenario.name)}, tests" for group in groups), "times the bound, mean")
    bounds = (
        ("minimum to show that what is left is minimal", *shown, "1.0"),
        ("minimum to find it, if all sets are equally likely", *likely, "–"),
    )
    table = Table(head, (*bounds, *rows), frozenset(range(1, len(head))))
    return Section("Which is best where", (*_words(groups), table, _about_the_bound()))


def _rank(entry: tuple[Method, tuple[Row, ...]]) -> tuple[bool, float]:
    """By the mean ratio of tests to bound; methods that are not minimal everywhere come last."""
    times = _times(entry[1])
    return times is None, times or 0.0


def _times(rows: Sequence[Row]) -> float | None:
    """The geometric mean of tests to bound: each scenario has the same weight, whatever its number of tests."""
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
    """The bound as a range, since cells may differ in how many models are left."""
    bounds = sorted({least_of(each, bound) for each in group.minimal})
    if not bounds:
        return "–"
    return str(bounds[0]) if len(bounds) == 1 else f"{bounds[0]} to {bounds[-1]}"


def _fewest(row: Row) -> float:
    return row.tests or 0.0


def _words(groups: Sequence[Group]) -> list[Block]:
    lines: list[Block] = []
    for group in groups:
        rows = [row for row in group.rows if row.tests is not None]
        if rows:
            first, last = min(rows, key=_fewest), max(rows, key=_fewest)
            equal = sum(row.tests == first.tests for row in rows) - 1
            also = f" and {count(equal, 'other')}" if equal else ""
            words = (
                f": {first.method.label}{also} with the fewest tests, {first.tests:g}; "
                f"{last.method.label} with the most, {last.tests:g}."
            )
            lines.append(say(Strong(plain(group.scenario.name)), words))
    return lines


def _about_the_bound() -> Block:
    return say(
        "Ranked by the ratio of tests to the first bound (geometric mean over the scenarios). No method needs fewer tests: after "
        "the baseline, f has to show in what is left, and each of its models has to be left out without success, with all re-runs. "
        "The second bound is for methods without any knowledge: the mean number of tests to find the needed set of models, if all "
        "sets of that size are equally likely. A method that first tries models near the failure may need fewer. The mark (◂) "
        "shows the fewest tests."
    )
