"""Models left after each test, a line for each method: the paper's Figure 2, as SVG with its colours as classes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from ddenv.amounts import count
from ddenv.errors import UserError
from ddenv.page.blocks import Block, Name, Part, Picture, plain, say
from ddenv.page.step_chart import BOTTOM, LEFT, RIGHT, TOP, WIDTH, At, axes, steps
from ddenv.report.report_map import CORNERS, picture
from ddenv.report.run_data import read_run
from ddenv.study.results import Found
from ddenv.study.rows import Group, Row, theirs
from ddenv.study.study_folder import run_path

HEIGHT = 320.0
LINE, SAMPLE = 22.0, 30.0
# Widths of the lines of methods with their own colour: where lines coincide, the wider first ones stay visible.
WIDTHS = (9.0, 5.0, 2.4, 2.2, 2.0, 2.0)


def chart(group: Group) -> str:
    """The chart of a scenario with at least one cell that came to an end."""
    named, others = _looks(group)
    last = max(1, *(each.tests for each in group.over))
    most = max(1, group.models)

    def at(tests: float, models: float) -> tuple[float, float]:
        x = LEFT + (WIDTH - LEFT - RIGHT) * tests / last
        return x, HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * models / most

    height = HEIGHT + LINE * (len(named) + bool(others)) + 4
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" role="img" viewBox="0 0 {WIDTH:.0f} {height:.0f}">',
        *axes(at, last, most),
    ]
    for row in others:
        parts += _lines(row, at, "faint")
    for number, row in enumerate(named):
        parts += _lines(row, at, f"look look{number}", WIDTHS[number])
    parts += _legend(named, others)
    return "\n".join([*parts, "</svg>"])


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
        corners = [at(*corner) for corner in steps(each.sizes)]
        line = "L".join(f"{x:.1f} {y:.1f}" for x, y in corners)
        title = escape(f"{plain(each.cell.label)}, seed {each.cell.seed}")
        yield f'<path class="{look}"{wide} d="M{line}"><title>{title}</title></path>'
        if width is not None:
            x, y = corners[-1]
            yield f'<circle class="{look} tip" cx="{x:.1f}" cy="{y:.1f}" r="{1.5 + width / 2:g}"/>'


def _legend(named: Sequence[Row], others: Sequence[Row]) -> Iterator[str]:
    y = HEIGHT + 4
    for number, row in enumerate(named):
        wide = WIDTHS[number]
        yield f'<path class="look look{number}" stroke-width="{wide:g}" d="M{LEFT} {y:.1f}h{SAMPLE}"/>'
        yield f'<text class="tick" x="{LEFT + SAMPLE + 10}" y="{y + 4:.1f}">{escape(plain(_line_end(row)))}</text>'
        y += LINE
    if others:
        yield f'<path class="faint" d="M{LEFT} {y:.1f}h{SAMPLE}"/>'
        words = count(len(others), "other method")
        yield f'<text class="tick" x="{LEFT + SAMPLE + 10}" y="{y + 4:.1f}">{words}</text>'


def _line_end(row: Row) -> str:
    if len(row.found) > 1:
        return f"{row.method.label}, {len(row.minimal)} of {len(row.found)} seeds certified"
    (only,) = row.over
    doubt = "" if only.minimal else ", not certified"
    return f"{row.method.label}: {count(len(only.left), 'model')} left after {count(only.tests, 'test')}{doubt}"


# The maximum number of worlds drawn for a scenario, and of models named for each.
MOST_WORLDS, MOST_NAMES = 4, 12


def worlds(folder: Path, group: Group, file: str) -> Iterator[Block]:
    """A map of each set of models that is left, the certified and frequent ones first; `file` is part of the pictures' names."""
    sets: dict[tuple[str, ...], list[Found]] = {}
    for each in group.over:
        sets.setdefault(each.left, []).append(each)
    ranked = sorted(sets.items(), key=lambda one: (-sum(each.minimal for each in one[1]), -len(one[1])))
    for number, (left, cells) in enumerate(ranked[:MOST_WORLDS], start=1):
        yield say(*_said(left, cells, len(group.over)))
        yield from _map(folder, cells[0], f"figure-3-{file}" + (f".{number}" if len(ranked) > 1 else ""))
    if len(ranked) > MOST_WORLDS:
        yield say(f"And {count(len(ranked) - MOST_WORLDS, 'more world')}, which fewer cells found.")


def _said(left: tuple[str, ...], cells: Sequence[Found], of_them: int) -> Iterator[Part]:
    minimal = any(each.minimal for each in cells)
    yield f"{'The minimal world' if minimal else 'What is left, not shown to be minimal'} (the paper's Figure 3)"
    yield f", the end of {len(cells)} of {of_them} cells: " if of_them > 1 else ": "
    if not left:
        yield "nothing that can be removed"
    for number, name in enumerate(left[:MOST_NAMES]):
        yield ", " if number else ""
        yield Name(name)
    yield f" and {len(left) - MOST_NAMES} more." if len(left) > MOST_NAMES else "."


def _map(folder: Path, found: Found, name: str) -> Iterator[Block]:
    from ddenv.map.footprints import plan

    try:
        record = read_run(run_path(folder, found.cell))
    except UserError as error:
        yield say(f"No map: {plain(error)}", notice=True)
        return
    if record.world is None:
        yield say("No map: the world cannot be read.", notice=True)
        return
    alternative = (
        f"The world of {plain(found.cell.scenario.name)} from above: what is left is solid, what was removed is faint."
    )
    yield Picture(name, picture(record, plan(record.world, CORNERS), name), alternative)
