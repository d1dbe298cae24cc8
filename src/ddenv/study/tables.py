"""The tables and charts of a study: which method is best where, and our numbers beside the
paper's.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence
from html import escape
from pathlib import Path
from statistics import geometric_mean

from ddenv.errors import UserError
from ddenv.evidence.rates import anytime_interval
from ddenv.page.blocks import (
    Block,
    Cell,
    Paragraph,
    Part,
    Picture,
    Section,
    Strong,
    Table,
    named,
    percent,
    say,
)
from ddenv.page.step_chart import LEFT, axes, opening, path, scale, steps
from ddenv.report.report_map import picture
from ddenv.report.run_data import read_run
from ddenv.study.plan import file_name, run_path
from ddenv.study.results import Result, Row, spread
from ddenv.text import Names, count, plain

HEIGHT = 320.0
LINE = 22.0
SAMPLE = 30.0
# Widths of the lines of methods with their own colour: where lines coincide, the wider first ones
# stay visible.
WIDTHS = (9.0, 5.0, 2.4, 2.2, 2.0, 2.0)
# The maximum number of worlds drawn for a scenario, of models named for each and in a table, and of
# cells named for a problem.
MOST_WORLDS = 4
MOST_LEFT = 12
MOST_NAMES = 8
MOST_CELLS = 3
# A comparison needs at least this many methods.
FEWEST = 4
BOUNDS = (
    "Search tests, the baseline included; certificates cost about the same after each method. "
    "Ranked by the ratio of tests to the bound (geometric mean over the scenarios); a method that "
    "is not certified with every seed is not ranked. No search needs fewer tests: after the "
    "baseline, f has to show in what is left, and each of its models has to be left out without "
    "success, with as many runs as a candidate without f takes. The mark (◂) shows the fewest "
    "tests."
)


def over(rows: Sequence[Row]) -> list[Result]:
    """The results of a scenario that came to an end."""
    return [result for row in rows for result in row.over]


def models(rows: Sequence[Row]) -> int:
    """How many models of a scenario can be removed; 0 before the first run."""
    return max(len(result.elements) for row in rows for result in row.results)


def chart(rows: Sequence[Row]) -> str:
    """The chart of a scenario with at least one result that came to an end."""
    own = [row for row in rows if row.over]
    others = list[Row]()
    if len(own) > len(WIDTHS):
        # With a colour of their own: the paper's methods, in their order, and those with the fewest
        # tests.
        own.sort(key=lambda row: (0,) if row.paper else (1, not row.certified, row.tests or 0.0))
        others = own[len(WIDTHS) :]
        own = own[: len(WIDTHS)]
    last = max(1, *(result.tests for result in over(rows)))
    most = max(1, models(rows))
    at = scale(last, most, HEIGHT)
    looks = [("faint", "", 0.0, row) for row in others]
    looks += [
        (f"look look{number}", f' stroke-width="{width:g}"', width, row)
        for number, (row, width) in enumerate(zip(own, WIDTHS, strict=False))
    ]
    lines: list[str] = []
    for look, wide, width, row in looks:
        for result in row.over:
            corners = steps(result.sizes)
            title = escape(f"{plain(result.cell.label)}, seed {result.cell.seed}")
            lines.append(
                f'<path class="{look}"{wide} d="M{path(corners, at)}"><title>{title}</title></path>'
            )
            if width:
                x, y = at(*corners[-1])
                lines.append(
                    f'<circle class="{look} tip" cx="{x:.1f}" cy="{y:.1f}" '
                    f'r="{1.5 + width / 2:g}"/>'
                )
    legend = [
        (look, wide, escape(plain(_line_end(row)))) for look, wide, _, row in looks[len(others) :]
    ]
    legend += [("faint", "", count(len(others), "other method"))] if others else []
    for number, (look, wide, words) in enumerate(legend):
        y = HEIGHT + 4 + LINE * number
        lines.append(f'<path class="{look}"{wide} d="M{LEFT} {y:.1f}h{SAMPLE}"/>')
        lines.append(f'<text class="tick" x="{LEFT + SAMPLE + 10}" y="{y + 4:.1f}">{words}</text>')
    return "\n".join(
        [opening(HEIGHT + LINE * len(legend) + 4), *axes(at, last, most), *lines, "</svg>"]
    )


def _line_end(row: Row) -> str:
    if len(row.results) > 1:
        return f"{row.method.label}, {len(row.minimal)} of {len(row.results)} seeds certified"
    (only,) = row.over
    doubt = "" if only.minimal else ", not certified"
    return (
        f"{row.method.label}: {count(len(only.left), 'model')} left after "
        f"{count(only.tests, 'test')}{doubt}"
    )


def worlds(folder: Path, rows: Sequence[Row], file: str) -> Iterator[Block]:
    """A map of each set of models that is left, the certified and frequent ones first; `file` is
    part of the pictures' names.
    """
    ends = defaultdict[Names, list[Result]](list)
    for result in over(rows):
        ends[result.left].append(result)
    ranked = sorted(
        ends.items(), key=lambda end: (-sum(result.minimal for result in end[1]), -len(end[1]))
    )
    for number, (left, results) in enumerate(ranked[:MOST_WORLDS], start=1):
        minimal = any(result.minimal for result in results)
        what = "The minimal world" if minimal else "What is left, not shown to be minimal"
        if len(over(rows)) > 1:
            of_them = f", the end of {len(results)} of {len(over(rows))} cells"
        else:
            of_them = ""
        these = named(left, MOST_LEFT) or ("nothing that can be removed",)
        yield say(f"{what} (the paper's Figure 3){of_them}: ", *these, ".")
        yield _map(
            folder, results[0], f"figure-3-{file}" + (f".{number}" if len(ranked) > 1 else "")
        )
    if len(ranked) > MOST_WORLDS:
        yield say(f"And {count(len(ranked) - MOST_WORLDS, 'more world')} that fewer cells found.")


def _map(folder: Path, result: Result, name: str) -> Block:
    try:
        record = read_run(run_path(folder, result.cell))
    except UserError as error:
        return say(f"No map: {plain(error)}", notice=True)
    if record.world is None:
        return say("No map: the world cannot be read.", notice=True)
    scenario = plain(result.cell.scenario.name)
    words = f"The world of {scenario} from above: what is left is solid, what was removed is faint."
    return Picture(name, picture(record, name), words)


def section(folder: Path, rows: Sequence[Row]) -> Section:
    scenario = rows[0].scenario
    file = file_name(scenario)
    table = next((row.paper.table for row in rows if row.paper), "")
    title = plain(scenario.name) + (f", {count(models(rows), 'model')}" if models(rows) else "")
    title += f" (Table {table} of the paper)" if table else ""
    blocks: list[Block] = [say(plain(scenario.description))] if scenario.description else []
    blocks += [numbers(rows), *_problems(rows)]
    if over(rows):
        caption = (
            "Models left after each test of the search, a line for each method (the paper's "
            "Figure 2):"
        )
        blocks += [behind(rows), say(caption), Picture(f"figure-2-{file}", chart(rows), caption)]
    blocks += worlds(folder, rows, file)
    return Section(title, tuple(blocks))


def _table(rows: Sequence[Sequence[tuple[str, Cell]]], right: Collection[int]) -> Table:
    head = tuple(title for title, _ in rows[0])
    return Table(head, tuple(tuple(cell for _, cell in row) for row in rows), right)


def numbers(rows: Sequence[Row]) -> Table:
    """Whether the result is certified; tests, reduction and minutes, beside the paper's if it has
    them.
    """
    beside = any(row.paper for row in rows)
    slices = any(row.sliced for row in rows)
    cells = [list(_numbers(row, beside, slices)) for row in rows]
    return _table(cells, range(2, len(cells[0])))


def _numbers(row: Row, beside: bool, slices: bool) -> Iterator[tuple[str, Cell]]:
    results = row.over
    paper = row.paper
    sliced = [result for result in row.sliced if result.certificate is not None]
    certified = f"{len(row.minimal)} of {len(row.results)}"
    if len(row.results) == 1:
        certified = "yes" if row.certified else "no"
    yield "partitioning, prioritization", row.method.label
    yield "certified", certified if results else "–"
    yield "search tests", spread([result.tests for result in results], _whole)
    if beside:
        yield "paper", str(paper.tests) if paper else "–"
    if slices:
        yield "with slices", spread([result.simulated for result in sliced], _whole)
    yield "certificate tests", spread([result.certificate_tests for result in results], _whole)
    if slices:
        yield "with slices", spread([result.certificate_simulated for result in sliced], _whole)
    yield "% reduction", spread([result.smaller for result in results], percent)
    if beside:
        yield "paper", percent(paper.smaller) if paper else "–"
    yield "search minutes", spread([result.seconds / 60 for result in results], "{:.1f}".format)
    if beside:
        yield "paper", str(paper.minutes) if paper else "–"
    yield (
        "certificate minutes",
        spread([result.certificate_seconds / 60 for result in results], "{:.1f}".format),
    )


def _whole(value: float) -> str:
    if value == int(value):
        return f"{value:.0f}"
    return f"{value:.1f}"


def behind(rows: Sequence[Row]) -> Table:
    """Details: re-runs, what is left, how often f shows in it, in the whole world and without one
    of the models.
    """
    return _table([list(_behind(row)) for row in rows], (1, 6, 7))


def _behind(row: Row) -> Iterator[tuple[str, Cell]]:
    claims = [
        claim for result in row.over if result.certificate for claim in result.certificate.claims
    ]
    left = [(claim.shown, claim.runs) for claim in claims if claim.without is None]
    whole = [(result.whole_f, result.whole_runs) for result in row.results]
    without = max(
        (claim for claim in claims if claim.without), key=lambda claim: claim.high, default=None
    )
    yield "method", row.method.label
    yield (
        "re-runs",
        spread([result.reruns / result.tests for result in row.over if result.tests], percent),
    )
    yield "models left", _left(row.over)
    yield "f in the whole world", _rate(whole)
    yield "f in what is left", _rate(left)
    yield (
        "f without one of them",
        f"at most {_rate([(without.shown, without.runs)])}" if without else "–",
    )
    yield "steps back", spread([result.steps_back for result in row.over], _whole)
    yield "fewest tests", "–" if row.bound is None else f"{row.bound:g}"


def _rate(parts: Sequence[tuple[int, int]]) -> str:
    """Runs that showed f, of how many, with the 95 % interval, which holds although the runs
    decided how many there were: "9 of 10 (51 % to >99 %)".
    """
    shown, runs = (sum(part[number] for part in parts) for number in (0, 1))
    if not runs:
        return "–"
    low, high = anytime_interval(shown, runs)
    return f"{shown} of {runs} ({percent(low)} to {percent(high)})"


def _left(results: Sequence[Result]) -> Cell:
    if not results:
        return "–"
    sets = Counter(result.left for result in results)
    words: list[Part] = []
    for left, times in sets.most_common():
        words += ["; " if words else "", *(named(left, MOST_NAMES) or ("none",))]
        words += [f" ({times} of {len(results)})"] if len(sets) > 1 else []
    return tuple(words)


def _problems(rows: Sequence[Row]) -> Iterator[Paragraph]:
    cells = defaultdict[str, list[str]](list)
    for row in rows:
        for result in (*row.results, *row.sliced):
            if problem := plain(result.problem).rstrip("."):
                slices = ", with slices" if result.cell.slices else ""
                cells[problem].append(f"{row.method.label}, seed {result.cell.seed}{slices}")
    for problem, names in cells.items():
        which = "; ".join(names) if len(names) <= MOST_CELLS else count(len(names), "cell")
        yield say(f"Not certified: {which}: {problem}.", notice=True)


def best(scenarios: Sequence[Sequence[Row]]) -> Section | None:
    """All methods, the fewest tests first; None if too few were tried."""
    if len(scenarios[0]) < FEWEST or not any(row.minimal for rows in scenarios for row in rows):
        return None
    fewest = [
        min((row.certain for row in rows if row.certain is not None), default=None)
        for rows in scenarios
    ]
    head = (
        "method",
        *(f"{plain(rows[0].scenario.name)}, tests" for rows in scenarios),
        "times the bound, mean",
    )
    # As a range, since cells may differ in how many models are left.
    bounds = (
        sorted({result.bound for row in rows for result in row.minimal}) for rows in scenarios
    )
    least = (
        " to ".join(map(str, dict.fromkeys((each[0], each[-1])))) if each else "–"
        for each in bounds
    )
    table: list[tuple[Cell, ...]] = [("minimum for a search that ends there", *least, "1.0")]
    ranked = []
    for rows in zip(*scenarios, strict=True):
        # Each scenario has the same weight, whatever its number of tests. Methods not certified
        # everywhere come last.
        ratios = [row.certain / row.bound for row in rows if row.certain is not None and row.bound]
        times = geometric_mean(ratios) if len(ratios) == len(rows) else math.inf
        cells = [_cell(row, few) for row, few in zip(rows, fewest, strict=True)]
        ranked.append(
            (times, (rows[0].method.label, *cells, f"{times:.1f}" if times < math.inf else "–"))
        )
    table += [row for _, row in sorted(ranked, key=lambda each: each[0])]
    return Section("Which is best where", (Table(head, table, range(1, len(head))), say(BOUNDS)))


def _cell(row: Row, fewest: float | None) -> Cell:
    if row.tests is None:
        if any(result.elements for result in row.results):
            return "not certified"
        return "not made yet"
    if not row.certified:
        return f"{row.tests:g} ({len(row.minimal)} of {len(row.results)} certified)"
    if row.tests == fewest:
        return Strong(f"{row.tests:g} ◂")
    return f"{row.tests:g}"
