"""The models that are left: how many after each test, as a chart; the part of each, its distance to
f, when it was sensed.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING

from rich.style import Style
from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widget import Widget
from textual.widgets import Static

from ddenv.runfile.progress import Point
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState, partition_letter
from ddenv.text import count, padded, shortened
from ddenv.workbench.terminal.themes import ink
from ddenv.workbench.widgets.lines import Lines

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# Columns behind the name: part, distance, first sensed.
REST = 3 + 9 + 9
LEVELS = " ▁▂▃▄▅▆▇█"
NEEDED = "╌"
DECIDED = "▲"
DIM = Style(dim=True)


class ModelsLeft(Vertical):
    """The list of models, the nearest to f first; it is filled only while it is in sight."""

    def __init__(self, find: Callable[[str], None], *, id: str) -> None:
        """`find` is called with the name of a model that was clicked."""
        super().__init__(id=id, classes="panel")
        self.border_title = "Models left"
        self._find = find
        self._made_of: tuple[object, ...] = ()
        # The part of each model, its footprint, and when it was sensed, simulated s; where f ended,
        # m.
        self._parts: dict[str, str] = {}
        self._prints: dict[str, Footprint] = {}
        self._sensed: dict[str, float] = {}
        self._f: tuple[float, float] | None = None

    def compose(self) -> ComposeResult:
        yield Static("", id="models-heading", markup=False)
        yield Lines(self._line, nothing="none", clicked=self._find, id="models")

    def show(self, state: RunState, prints: Sequence[Footprint]) -> None:
        split = None if state.round is None or state.round.done else state.round.split
        made_of = (
            state.environment,
            split,
            state.pinned,
            state.evidence_test,
            state.baseline,
            prints,
        )
        lines = self.query_one("#models", Lines)
        if made_of == self._made_of or not (width := lines.size.width):
            return
        self._made_of = made_of
        heading = f"{'model':<{max(4, width - REST)}}{'in':>3}{'from f':>9}{'sensed':>9}"
        self.query_one("#models-heading", Static).update(heading)
        parts = {} if split is None else split.letter_of
        self._parts = {
            name: partition_letter(part) for name, part in parts.items()
        } | dict.fromkeys(state.pinned, "+")
        self._prints = {each.name: each for each in prints}
        self._sensed = {} if state.evidence is None else dict(state.evidence.first_sensed)
        self._f = None if state.f_position is None else state.f_position[:2]
        lines.show(sorted(state.environment, key=self._nearly))

    def _nearly(self, name: str) -> float:
        """How far from f the rectangle around a model is, m: exact distances only for models in
        sight, of thousands.
        """
        stands = self._prints.get(name)
        if stands is None or self._f is None:
            return math.inf
        sides = zip(stands.low, self._f, stands.high, strict=True)
        return math.hypot(*(max(low - at, at - high, 0.0) for low, at, high in sides))

    def _line(self, name: str, width: int) -> Text:
        room = max(4, width - REST)
        stands = self._prints.get(name)
        away = "" if stands is None or self._f is None else f"{stands.distance(self._f):.1f} m"
        sensed = f"{self._sensed[name]:.1f} s" if name in self._sensed else "never"
        text = Text(padded(shortened(name, room), room), no_wrap=True)
        return (
            text.append(f"{self._parts.get(name, ''):>3}", "bold")
            .append(f"{away:>9}")
            .append(f"{sensed:>9}", "dim")
        )


@dataclass(frozen=True, slots=True)
class Course:
    """What the chart shows: the size of the environment over `tests`, and after how many tests the
    user `decided` something.
    """

    points: Sequence[Point] = ()
    tests: int = 0
    needed: int = 0
    decided: Sequence[int] = ()


class Chart(Widget):
    """Steps of the environment's size over the finished tests, filled, eight levels to a line."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._course = Course()

    def show(self, snapshot: Snapshot) -> None:
        state = snapshot.state
        decided = tuple(decision.tests for decision in state.decisions)
        course = Course(state.history, state.tests_done, state.lower_bound, decided)
        if course != self._course:
            self._course = course
            self.refresh()

    def render(self) -> Text:
        colors = self.app.theme_variables
        top = ink(colors, "primary")
        # The terminal's own colours have no darker variants.
        below = top + DIM if self.app.native_ansi_color else ink(colors, "primary-muted")
        return steps(self._course, *self.size, (top, below, ink(colors, "text-warning", bold=True)))


def steps(
    course: Course, width: int, height: int, styles: tuple[Style, Style, Style] = (Style(),) * 3
) -> Text:
    """The chart as text of `height` lines; the last one is the axis of tests.

    The styles are those of the tops of the steps, of what is below, and of the line of needed
    models.
    """
    points = course.points
    if not points or width < 12 or height < 3:
        return Text("")
    most = max(1, max(point.models for point in points))
    last = max(1, course.tests, points[-1].tests)
    margin = len(str(most)) + 1
    columns = width - margin - 1
    ruled = height >= 6 or (height >= 4 and bool(course.decided))
    rows = height - 1 - ruled
    # For each column, how many models were left, and in which row the line of needed ones is: below
    # the chart without any.
    left = []
    levels = []
    for column in range(columns):
        at = last * column / max(1, columns - 1)
        place = max(0, bisect_right(points, at, key=lambda point: point.tests) - 1)
        needed = max(points[place].needed, course.needed if place == len(points) - 1 else 0)
        left.append(points[place].models)
        levels.append(
            min(rows - 1, rows - 1 - int((needed / most) * rows - 1e-9)) if needed else rows
        )
    marks = {0: str(most), rows - 1: "0"}
    middle = rows // 2
    if rows >= 5 and (words := str(round(most * (1 - middle / rows)))) not in marks.values():
        marks[middle] = words
    if course.needed and levels[-1] < rows:
        marks.setdefault(levels[-1], str(course.needed))
    text = Text(no_wrap=True)
    for row in range(rows):
        text.append(f"{marks.get(row, ''):>{margin - 1}}{'┤' if row in marks else '│'}", "dim")
        cells = []
        for models, level in zip(left, levels, strict=True):
            eighths = max(1 if models else 0, round(models / most * rows * 8)) - 8 * (
                rows - 1 - row
            )
            char = LEVELS[min(8, max(0, eighths))]
            full = eighths > 8
            # Where steps and line meet in one row, the steps are drawn.
            cells.append((NEEDED, 2) if level == row and full else (char, int(full)))
        for kind, chars in groupby(cells, itemgetter(1)):
            text.append("".join(char for char, _ in chars), styles[kind])
        text.append("\n")
    if ruled:
        decided = {round(min(tests, last) * (columns - 1) / last) for tests in course.decided}
        rule = Text(f"{'':>{margin - 1}}└", "dim")
        for column in range(columns):
            rule.append(*((DECIDED, styles[2]) if column in decided else ("─", DIM)))
        text.append_text(rule).append("\n")
    end = count(course.tests, "test")
    words = f"{count(points[-1].models, 'model')} left"
    space = columns - 1 - len(end)
    least = f"{words}, at least {course.needed} needed" if course.needed else words
    fitting = next((each for each in (least, words) if len(each) + 2 <= space), "")
    return text.append(f"{'':>{margin - 1}}0{fitting.center(space)}{end}", "dim")
