"""The list of recent runs, and the table of all runs with as many columns as fit."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from typing import Any, ClassVar

from rich.text import Text
from textual import events, work
from textual.binding import Binding
from textual.widgets import DataTable, OptionList
from textual.widgets.option_list import Option

from ddenv.text import count, first_of, plain, shortened
from ddenv.words.signs import brief
from ddenv.workbench.runs.recent_runs import SHOWN, Recent, RunsFolder
from ddenv.workbench.shared import poll
from ddenv.workbench.shared.background import call_if_open

# The maximum number of models to name.
MOST_NAMES = 40


class RunList(OptionList):
    """The runs of the runs folder, read in a thread."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._runs: dict[str, Recent] = {}
        self._folder: RunsFolder | None = None

    def run_of(self, option_id: str | None) -> Recent:
        """The run of an option."""
        return self._runs[option_id or ""]

    @work(thread=True, group="runs", exclusive=True)
    def read(self) -> None:
        """Reads the folder again."""
        from ddenv.runs.folder import runs_folder

        self._folder = self._folder or RunsFolder(runs_folder())
        runs = self._folder.look(most=SHOWN)
        call_if_open(self, self._show, runs)

    def on_focus(self) -> None:
        """The cursor is on the newest run, so that enter opens something."""
        if self.highlighted is None and self._runs:
            self.highlighted = 0

    def on_resize(self) -> None:
        at = self.highlighted
        if self._runs:
            self._show(list(self._runs.values()))
            self.highlighted = at

    def _show(self, runs: list[Recent]) -> None:
        self._runs = {str(run.path): run for run in runs}
        self.clear_options()
        width = self.scrollable_content_region.width or self.app.size.width
        for run in runs:
            text = Text(f"{run.sign} {plain(run.path.stem)}", no_wrap=True, overflow="ellipsis")
            words = run.words if text.cell_len + len(run.words) + 2 <= width else run.brief
            self.add_option(Option(text.append(f"  {words}" if words else "", "dim"), id=str(run.path)))
        if not runs:
            self.add_option(Option(Text("none yet", "dim"), disabled=True))


def about(run: Recent, width: int) -> Text:
    """All details of a run, for a column of that `width`."""
    text = Text(shortened(plain(run.path.stem), width), "bold").append("\n")
    if run.trouble:
        return text.append(f"\n{plain(run.trouble)}", "not bold")
    text.append(f"{run.sign} {run.state_words}\n", "not bold")
    if run.reason:
        text.append(f"{plain(run.reason)}\n", "not bold dim")
    facts = [
        ("scenario", shortened(run.scenario, max(8, width - 10))),
        ("algorithm", run.algorithm),
        ("pair", run.pair if len(run.pair) + 10 <= width else run.pair.replace("/", f"/\n{'':10}")),
        ("tests", str(run.tests)),
        ("computing", f"{brief(run.computed)} of simulations"),
        ("decisions", f"{run.decisions} by hand" if run.decisions else "none by hand"),
    ]
    for name, words in facts:
        text.append(f"\n{name:<10}", "not bold dim").append(words, "not bold")
    text.append(f"\n\n{len(run.kept)} of {count(run.total, 'model')} left\n", "bold")
    for name in run.kept[:MOST_NAMES]:
        text.append(f"  {shortened(plain(name), max(8, width - 2))}\n", "not bold")
    more = len(run.kept) - MOST_NAMES
    return text.append(f"  and {more} more\n" if more > 0 else "", "not bold dim")


def in_few_lines(run: Recent) -> Text:
    """What the table has no room for at 80 columns."""
    text = Text(plain(run.path.stem), "bold")
    said = run.trouble or "; ".join(part for part in (f"{run.sign} {run.state_words}", run.reason) if part)
    text.append(f"\n{plain(said)}", "not bold")
    if run.trouble:
        return text
    text.append(f"\n{plain(run.scenario)} by {plain(run.algorithm)}, {plain(run.pair)}", "not bold")
    return text.append(
        f"\nleft: {first_of([plain(name) for name in run.kept], MOST_NAMES)}" if run.kept else "", "not bold dim"
    )


def left_of(total: int, left: int) -> str:
    """How many models are left, in a column of 10 cells where they are thousands, too."""
    words = f"{left} of {total}" if total else ""
    return words if len(words) <= 10 else f"{left}/{total}"


# All columns but the name, which takes the rest: title, width, whether it is a number, and its text.
_Column = tuple[str, int, bool, Callable[[Recent], str]]
FIRST: tuple[_Column, ...] = (
    ("state", 16, False, lambda run: f"{run.sign} {run.state_words}"),
    ("left", 10, True, lambda run: left_of(run.total, len(run.kept))),
    ("tests", 6, True, lambda run: str(run.tests) if run.total else ""),
    ("cost", 7, True, lambda run: brief(run.computed) if run.total else ""),
)
# Columns are added in this order while they fit.
MORE: tuple[_Column, ...] = (
    ("changed", 11, True, lambda run: moment(run.changed)),
    ("scenario", 16, False, lambda run: plain(run.scenario)),
    ("started", 11, True, lambda run: moment(run.started)),
    ("size", 8, True, lambda run: size(run.size)),
)
# By what the runs are sorted, in the order in which a key goes through it. Numbers and times begin with the most.
ORDERS: dict[str, Callable[[Recent], Any]] = {
    "changed": lambda run: -run.changed,
    "name": lambda run: run.path.stem.casefold(),
    "state": lambda run: run.state_words,
    "scenario": lambda run: run.scenario.casefold(),
    "left": lambda run: len(run.kept) if run.total else math.inf,
    "tests": lambda run: -run.tests,
    "cost": lambda run: -run.computed,
    "started": lambda run: -run.started,
    "size": lambda run: -run.size,
}
NARROWEST_NAME = 12
# Each column has a space at both sides of its text.
AROUND = 2


def size(number: int) -> str:
    """Bytes as 12 kB or 4.7 MB."""
    return f"{number / 1000:.0f} kB" if number < 1e6 else f"{number / 1e6:.1f} MB"


def moment(time: float) -> str:
    """A Unix time, s: the time of day if it is today, else the date."""
    if not time:
        return ""
    try:
        then, today = datetime.fromtimestamp(time), datetime.fromtimestamp(poll.now()).date()
    except (ValueError, OverflowError, OSError):
        # File systems allow years beyond the calendar.
        return "?"
    return f"{then:%H:%M:%S}" if then.date() == today else f"{then.day} {then:%b %Y}"


class RunTable(DataTable[Text]):
    """One row per run; only changed cells are drawn again."""

    BINDINGS: ClassVar = [
        Binding("enter", "select_cursor", "open", id="runs.open", tooltip="open the run under the cursor"),
        Binding("home", "scroll_top", "first", id="runs.first", tooltip="to the first run", show=False),
        Binding("end", "scroll_bottom", "last", id="runs.last", tooltip="to the last run", show=False),
    ]

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, cursor_type="row", zebra_stripes=False)
        self._runs: list[Recent] = []
        self._wide = 0
        self._order = ""
        self._name_width = NARROWEST_NAME
        self._cells: dict[str, list[str]] = {}

    @property
    def chosen(self) -> Recent | None:
        """The run under the cursor."""
        return self._runs[self.cursor_row] if 0 <= self.cursor_row < len(self._runs) else None

    def show(self, runs: list[Recent], order: str = "") -> None:
        """Shows these in this order, whose column is marked; the cursor stays on its run."""
        chosen = self.chosen
        if order and order != self._order:
            self._order, self._wide = order, 0
        same = self._wide == self.size.width and [run.path for run in runs] == [run.path for run in self._runs]
        self._runs = list(runs)
        if not same:
            self._fill()
            paths = [run.path for run in runs]
            if chosen is not None and chosen.path in paths:
                self.move_cursor(row=paths.index(chosen.path), animate=False)
            return
        for run in runs:
            self._refill(run)

    def on_resize(self, event: events.Resize) -> None:
        self.show(self._runs)

    def action_scroll_top(self) -> None:
        self.move_cursor(row=0)

    def action_scroll_bottom(self) -> None:
        self.move_cursor(row=len(self._runs) - 1)

    def _fill(self) -> None:
        self._wide = self.size.width
        self.clear(columns=True)
        self._cells = {}
        columns = self._columns()
        name = self._wide - sum(column[1] + AROUND for column in columns) - AROUND - 1
        self._name_width = max(NARROWEST_NAME, name)
        self.add_column(self._title("name"), width=self._name_width, key="name")
        for title, width, number, _ in columns:
            self.add_column(Text(self._title(title), justify="right" if number else "left"), width=width, key=title)
        for run in self._runs:
            cells = self._row(run)
            self._cells[str(run.path)] = cells
            self.add_row(*self._drawn(cells), key=str(run.path))

    def _title(self, name: str) -> str:
        return f"▾{name}" if name == self._order else name

    def _refill(self, run: Recent) -> None:
        key, cells = str(run.path), self._row(run)
        if self._cells.get(key) == cells:
            return
        before, self._cells[key] = self._cells[key], cells
        for column, was, cell, drawn in zip(self.ordered_columns, before, cells, self._drawn(cells), strict=True):
            if was != cell:
                self.update_cell(key, column.key, drawn)

    def _columns(self) -> list[_Column]:
        columns = list(FIRST)
        for column in MORE:
            if sum(each[1] + AROUND for each in (*columns, column)) + NARROWEST_NAME + AROUND < self._wide:
                columns.append(column)
        return columns

    def _row(self, run: Recent) -> list[str]:
        words = [shortened(say(run), width) for _, width, _, say in self._columns()]
        return [shortened(plain(run.path.stem), self._name_width), *words]

    def _drawn(self, cells: list[str]) -> list[Text]:
        numbers = [False, *(number for _, _, number, _ in self._columns())]
        return [
            Text(cell, justify="right" if number else "left", no_wrap=True)
            for cell, number in zip(cells, numbers, strict=True)
        ]
