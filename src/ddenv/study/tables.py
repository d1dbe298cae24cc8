"""The tables and charts of a study: which method is best where, and our numbers beside the paper's."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from statistics import geometric_mean

from ddenv.errors import UserError
from ddenv.evidence.rates import anytime_interval
from ddenv.page.blocks import Block, Cell, Paragraph, Part, Picture, Section, Strong, Table, named, percent, say
from ddenv.page.step_chart import LEFT, At, axes, opening, path, scale, steps
from ddenv.report.report_map import picture
from ddenv.report.run_data import read_run
from ddenv.study.plan import file_name, run_path
from ddenv.study.results import Found, Group, Row, Theirs, spread, theirs
from ddenv.text import count, plain

HEIGHT = 320.0
LINE, SAMPLE = 22.0, 30.0
# Widths of the lines of methods with their own colour: where lines coincide, the wider first ones stay visible.
WIDTHS = (9.0, 5.0, 2.4, 2.2, 2.0, 2.0)
# The maximum number of worlds drawn for a scenario, and of models named for each.
MOST_WORLDS, MOST_LEFT = 4, 12
# The maximum number of models that are named.
MOST_NAMES = 8
# The maximum number of cells with the same problem that are named.
MOST_CELLS = 3
BEHIND = (
    *("method", "re-runs", "models left", "f in the whole world", "f in what is left", "f without one of them"),
    *("steps back", "least tests"),
)
# A comparison needs at least this many methods.
FEWEST = 4
BOUNDS = (
    "Search tests, the baseline included; certificates cost about the same after each method. Ranked by the ratio of tests to "
    "the first bound (geometric mean over the scenarios); a method that is not certified with every seed is not ranked. No "
    "search needs fewer tests: after the baseline, f has to show in what is left, and each of its models has to be left out "
    "without success, with as many runs as a candidate without f takes. The second bound is for methods without any "
    "knowledge: the mean number of tests to find the needed set of models, if all sets of that size are equally likely. A "
    "method that first tries models near the failure may need fewer. The mark (◂) shows the fewest tests."
)


def chart(group: Group) -> str:
    """The chart of a scenario with at least one cell that came to an end."""
    named, others = _looks(group)
    last, most = max(1, *(each.tests for each in group.over)), max(1, group.models)
    at = scale(last, most, HEIGHT)
    own = [(row, f"look look{number}", width) for number, (row, width) in enumerate(zip(named, WIDTHS, strict=False))]
    lines = [line for row in others for line in _lines(row, at, "faint")]
    lines += [line for row, look, width in own for line in _lines(row, at, look, width)]
    legend = [(look, f' stroke-width="{width:g}"', escape(plain(_line_end(row)))) for row, look, width in own]
    legend += [("faint", "", count(len(others), "other method"))] if others else []
    for number, (look, wide, words) in enumerate(legend):
        y = HEIGHT + 4 + LINE * number
        lines.append(f'<path class="{look}"{wide} d="M{LEFT} {y:.1f}h{SAMPLE}"/>')
        lines.append(f'<text class="tick" x="{LEFT + SAMPLE + 10}" y="{y + 4:.1f}">{words}</text>')
    height = HEIGHT + LINE * len(legend) + 4
    return "\n".join([opening(height), *axes(at, last, most), *lines, "</svg>"])


def _looks(group: Group) -> tuple[list[Row], list[Row]]:
    """The rows with their own colour, and all others: of many, the paper's methods and those with the fewest tests."""
    rows = [row for row in group.rows if row.over]
    if len(rows) <= len(WIDTHS):
        return rows, []
    first = [row for row in rows if theirs(row.found[0].cell) is not None]
    best = sorted((row for row in rows if row not in first), key=lambda row: (not row.certified, row.tests or 0.0))
    named = [*first, *best][: len(WIDTHS)]
    return named, [row for row in rows if row not in named]


def _lines(row: Row, at: At, look: str, width: float | None = None) -> Iterator[str]:
    wide = "" if width is None else f' stroke-width="{width:g}"'
    for each in row.over:
        corners = steps(each.sizes)
        title = escape(f"{plain(each.cell.label)}, seed {each.cell.seed}")
        yield f'<path class="{look}"{wide} d="M{path(corners, at)}"><title>{title}</title></path>'
        if width is not None:
            x, y = at(*corners[-1])
            yield f'<circle class="{look} tip" cx="{x:.1f}" cy="{y:.1f}" r="{1.5 + width / 2:g}"/>'


def _line_end(row: Row) -> str:
    if len(row.found) > 1:
        return f"{row.method.label}, {len(row.minimal)} of {len(row.found)} seeds certified"
    (only,) = row.over
    doubt = "" if only.minimal else ", not certified"
    return f"{row.method.label}: {count(len(only.left), 'model')} left after {count(only.tests, 'test')}{doubt}"


def worlds(folder: Path, group: Group, file: str) -> Iterator[Block]:
    """A map of each set of models that is left, the certified and frequent ones first; `file` is part of the pictures' names."""
    ends = defaultdict[tuple[str, ...], list[Found]](list)
    for each in group.over:
        ends[each.left].append(each)
    ranked = sorted(ends.items(), key=lambda one: (-sum(each.minimal for each in one[1]), -len(one[1])))
    for number, (left, cells) in enumerate(ranked[:MOST_WORLDS], start=1):
        minimal = any(each.minimal for each in cells)
        what = "The minimal world" if minimal else "What is left, not shown to be minimal"
        of_them = f", the end of {len(cells)} of {len(group.over)} cells" if len(group.over) > 1 else ""
        these = named(left, MOST_LEFT) or ("nothing that can be removed",)
        yield say(f"{what} (the paper's Figure 3){of_them}: ", *these, ".")
        yield _map(folder, cells[0], f"figure-3-{file}" + (f".{number}" if len(ranked) > 1 else ""))
    if len(ranked) > MOST_WORLDS:
        yield say(f"And {count(len(ranked) - MOST_WORLDS, 'more world')}, which fewer cells found.")


def _map(folder: Path, found: Found, name: str) -> Block:
    try:
        record = read_run(run_path(folder, found.cell))
    except UserError as error:
        return say(f"No map: {plain(error)}", notice=True)
    if record.world is None:
        return say("No map: the world cannot be read.", notice=True)
    scenario = plain(found.cell.scenario.name)
    words = f"The world of {scenario} from above: what is left is solid, what was removed is faint."
    return Picture(name, picture(record, name), words)


def section(folder: Path, group: Group) -> Section:
    """The section on one scenario."""
    file, paper = file_name(group.scenario), _papers(group)
    title = plain(group.scenario.name) + (f", {count(group.models, 'model')}" if group.models else "")
    title += f" (Table {paper[0].table} of the paper)" if paper else ""
    blocks: list[Block] = [say(plain(group.scenario.description))] if group.scenario.description else []
    blocks += [numbers(group), *_slices(group), *_problems(group)]
    if group.over:
        caption = "Models left after each test of the search, a line for each method (the paper's Figure 2):"
        blocks += [behind(group), say(caption), Picture(f"figure-2-{file}", chart(group), caption)]
    blocks += worlds(folder, group, file)
    return Section(title, tuple(blocks))


def numbers(group: Group) -> Table:
    """Whether the result is certified; tests, reduction and minutes, beside the paper's if it has them."""
    beside, slices = bool(_papers(group)), any(row.sliced for row in group.rows)
    rows = [tuple(_numbers(row, beside, slices)) for row in group.rows]
    head = tuple(title for title, _ in rows[0])
    return Table(head, tuple(tuple(cell for _, cell in row) for row in rows), frozenset(range(2, len(head))))


def _numbers(row: Row, beside: bool, slices: bool) -> Iterator[tuple[str, Cell]]:
    """The titles and cells of a row."""
    over, sliced = row.over, [each for each in row.sliced if each.certificate is not None]
    paper = theirs(row.found[0].cell)
    yield "partitioning, prioritization", row.method.label
    yield "certified", _certified(row)
    yield "search tests", spread([each.tests for each in over], _whole)
    if beside:
        yield "paper", "–" if paper is None else str(paper.tests)
    if slices:
        yield "with slices", spread([each.simulated for each in sliced], _whole)
    yield "certificate tests", spread([each.certificate_tests for each in over], _whole)
    if slices:
        yield "with slices", spread([each.certificate_simulated for each in sliced], _whole)
    yield "% reduction", spread([each.smaller for each in over], percent)
    if beside:
        yield "paper", "–" if paper is None else percent(paper.smaller)
    yield "search minutes", spread([each.seconds / 60 for each in over], "{:.1f}".format)
    if beside:
        yield "paper", "–" if paper is None else str(paper.minutes)
    yield "certificate minutes", spread([each.certificate_seconds / 60 for each in over], "{:.1f}".format)


def _slices(group: Group) -> Iterator[Paragraph]:
    """What the cells with slices came to, beside those without."""
    pairs = [pair for row in group.rows if row.sliced for pair in zip(row.found, row.sliced, strict=True)]
    over = [(without, sliced) for without, sliced in pairs if without.certificate and sliced.certificate]
    if over:
        alike = sum(frozenset(without.left) == frozenset(sliced.left) for without, sliced in over)
        certified = sum(sliced.minimal for _, sliced in over)
        yield say(
            f"With slices {alike} of {count(len(over), 'cell')} end at the same models as without them, and {certified} are "
            "certified."
        )


def _certified(row: Row) -> str:
    if not row.over:
        return "–"
    if len(row.found) == 1:
        return "yes" if row.certified else "no"
    return f"{len(row.minimal)} of {len(row.found)}"


def _whole(value: float) -> str:
    return f"{value:.0f}" if value == int(value) else f"{value:.1f}"


def _papers(group: Group) -> list[Theirs]:
    """The rows of the paper's table of the scenario."""
    return [paper for row in group.rows if (paper := theirs(row.found[0].cell)) is not None]


def behind(group: Group) -> Table:
    """Details: re-runs, what is left, how often f shows in it, in the whole world and without one of the models."""
    return Table(BEHIND, tuple(_behind(row) for row in group.rows), frozenset({1, 6, 7}))


def _behind(row: Row) -> tuple[Cell, ...]:
    over = row.over
    claims = [claim for each in over if each.certificate for claim in each.certificate.claims]
    of_left = [claim for claim in claims if claim.without is None]
    # The highest of the rates without one of the models.
    without = max((claim for claim in claims if claim.without), key=lambda claim: claim.high, default=None)
    reruns = spread([each.reruns / each.tests for each in over if each.tests], percent)
    bound = "–" if row.bound is None else f"{row.bound:g}"
    back = spread([each.steps_back for each in over], _whole)
    rates = (
        _rate(sum(each.whole_f for each in row.found), sum(each.whole_runs for each in row.found)),
        _rate(sum(claim.shown for claim in of_left), sum(claim.runs for claim in of_left)),
        "–" if without is None else f"at most {_rate(without.shown, without.runs)}",
    )
    return row.method.label, reruns, _left(over), *rates, back, bound


def _rate(shown: int, runs: int) -> str:
    """With its 95 % interval, which holds although the runs decided how many there were: "9 of 10 (51 % to >99 %)"."""
    if not runs:
        return "–"
    low, high = anytime_interval(shown, runs)
    return f"{shown} of {runs} ({percent(low)} to {percent(high)})"


def _left(over: tuple[Found, ...]) -> Cell:
    """Each set of models that is left, the most frequent first."""
    if not over:
        return "–"
    sets = Counter(each.left for each in over)
    words: list[Part] = []
    for left, times in sets.most_common():
        words += ["; " if words else "", *(named(left, MOST_NAMES) or ("none",))]
        words += [f" ({times} of {len(over)})"] if len(sets) > 1 else []
    return tuple(words)


def _problems(group: Group) -> Iterator[Paragraph]:
    """The cells that are not certified, and why."""
    cells: dict[str, list[str]] = {}
    for row in group.rows:
        for each in (*row.found, *row.sliced):
            if problem := plain(each.problem).rstrip("."):
                slices = ", with slices" if each.cell.slices else ""
                cells.setdefault(problem, []).append(f"{row.method.label}, seed {each.cell.seed}{slices}")
    for problem, names in cells.items():
        which = "; ".join(names) if len(names) <= MOST_CELLS else count(len(names), "cell")
        yield say(f"Not certified: {which}: {problem}.", notice=True)


def best(groups: Sequence[Group]) -> Section | None:
    """All methods, the fewest tests first; None if too few were tried."""
    methods = [row.method for row in groups[0].rows]
    if len(methods) < FEWEST or not any(group.minimal for group in groups):
        return None
    least = [
        min((tests for row in group.rows if (tests := _certain(row)) is not None), default=None) for group in groups
    ]
    # Methods that are not certified everywhere come last.
    ranked = sorted(
        (
            (_times(rows), method, rows)
            for method, *rows in zip(methods, *(group.rows for group in groups), strict=True)
        ),
        key=lambda entry: entry[0] or math.inf,
    )
    head = ("method", *(f"{plain(group.scenario.name)}, tests" for group in groups), "times the bound, mean")
    shown, likely = (tuple(_bound(group, which) for group in groups) for which in (0, 1))
    rows: list[tuple[Cell, ...]] = [
        ("minimum for a search that ends there", *shown, "1.0"),
        ("minimum to find it, if all sets are equally likely", *likely, "–"),
    ]
    for times, method, own in ranked:
        cells = [_cell(row, fewest) for row, fewest in zip(own, least, strict=True)]
        rows.append((method.label, *cells, "–" if times is None else f"{times:.1f}"))
    table = Table(head, tuple(rows), frozenset(range(1, len(head))))
    return Section("Which is best where", (*_words(groups), table, say(BOUNDS)))


def _times(rows: Sequence[Row]) -> float | None:
    """The geometric mean of tests to bound: each scenario has the same weight, whatever its number of tests."""
    ratios = [tests / row.bound for row in rows if (tests := _certain(row)) is not None and row.bound]
    return geometric_mean(ratios) if len(ratios) == len(rows) else None


def _certain(row: Row) -> float | None:
    """The tests of a method that is certified with all seeds; None for another, which is no success."""
    return row.tests if row.certified else None


def _cell(row: Row, fewest: float | None) -> Cell:
    if row.tests is None:
        return "not certified" if any(each.elements for each in row.found) else "not made yet"
    if not row.certified:
        return f"{row.tests:g} ({len(row.minimal)} of {len(row.found)} certified)"
    return Strong(f"{row.tests:g} ◂") if row.tests == fewest else f"{row.tests:g}"


def _bound(group: Group, which: int) -> str:
    """One of the bounds as a range, since cells may differ in how many models are left."""
    bounds = sorted({each.bounds[which] for each in group.minimal})
    return " to ".join(map(str, dict.fromkeys((bounds[0], bounds[-1])))) if bounds else "–"


def _words(groups: Sequence[Group]) -> Iterator[Block]:
    for group in groups:
        rows = sorted(
            ((tests, row.method.label) for row in group.rows if (tests := _certain(row)) is not None),
            key=lambda one: one[0],
        )
        if rows:
            (fewest, first), most = rows[0], rows[-1][0]
            last = next(label for tests, label in rows if tests == most)
            equal = sum(tests == fewest for tests, _ in rows) - 1
            also = f" and {count(equal, 'other')}" if equal else ""
            words = f": {first}{also} with the fewest tests, {fewest:g}; {last} with the most, {most:g}."
            yield say(Strong(plain(group.scenario.name)), words)
