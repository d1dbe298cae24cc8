"""How many models were left after each test: falling steps, filled, eight levels to a line."""

from __future__ import annotations

from rich.text import Text
from textual.widget import Widget

from ddenv.runfile.state import Point
from ddenv.workbench.poll import Snapshot
from ddenv.workbench.wording import count

LEVELS = " ▁▂▃▄▅▆▇█"


class Chart(Widget):
    """Steps of the environment's size over the finished tests."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._points: tuple[Point, ...] = ()
        self._tests = 0

    def show(self, snapshot: Snapshot) -> None:
        points, tests = snapshot.state.history, snapshot.state.tests_done
        if (points, tests) != (self._points, self._tests):
            self._points, self._tests = points, tests
            self.refresh()

    def render(self) -> Text:
        colors = self.app.theme_variables
        return steps(self._points, self._tests, *self.size, colors["primary"], colors["primary-muted"])


def steps(points: tuple[Point, ...], tests: int, width: int, height: int, bright: str = "", dark: str = "") -> Text:
    """The chart as text of `height` lines; the last one is the axis of tests."""
    if not points or width < 12 or height < 3:
        return Text("")
    most = max(1, max(point.models for point in points))
    last = max(1, tests, *(point.tests for point in points))
    margin = len(str(most)) + 1
    columns, rows = width - margin - 1, height - 1
    sizes = [_size_at(points, last * column / max(1, columns - 1)) for column in range(columns)]
    marks = {0: str(most), rows - 1: "0"}
    if rows >= 5:
        marks[rows // 2] = str(round(most * (1 - (rows // 2) / rows)))
    text = Text(no_wrap=True)
    for row in range(rows):
        text.append(f"{marks.get(row, ''):>{margin - 1}}┤" if row in marks else f"{'':>{margin - 1}}│", "dim")
        for char, top in _line(sizes, most, rows, row):
            text.append(char, bright if top else dark)
        text.append("\n")
    return text.append_text(_axis(points, tests, margin, columns))


def _line(sizes: list[int], most: int, rows: int, row: int) -> list[tuple[str, bool]]:
    """The characters of a row, and whether each is the top of its column."""
    eighths = [max(1 if size else 0, round(size / most * rows * 8)) - 8 * (rows - 1 - row) for size in sizes]
    return [(LEVELS[min(8, max(0, each))], each <= 8) for each in eighths]


def _axis(points: tuple[Point, ...], tests: int, margin: int, columns: int) -> Text:
    end = count(tests, "test")
    now = f"{count(points[-1].models, 'model')} left"
    space = columns - 1 - len(end)
    middle = now.center(space) if len(now) + 2 <= space else " " * space
    return Text(f"{'':>{margin - 1}}0{middle}{end}", "dim", no_wrap=True)


def _size_at(points: tuple[Point, ...], tests: float) -> int:
    size = points[0].models
    for point in points:
        if point.tests > tests:
            break
        size = point.models
    return size
