"""The list of recent runs, the table of all runs with as many columns as fit, and what is said of
one run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from typing import Any, ClassVar

from rich.text import Text
from textual import work
from textual.widgets import DataTable, OptionList
from textual.widgets.option_list import Option

from ddenv.runs.folder import runs_folder
from ddenv.runs.recent import Recent
from ddenv.text import count, first_of, plain, shortened
from ddenv.words.signs import brief
from ddenv.workbench.runs.recent_runs import SHOWN, RunsFolder
from ddenv.workbench.shared import poll
from ddenv.workbench.shared.background import call_if_open
from ddenv.workbench.shared.bindings import keys

# The maximum number of models to name.
MOST_NAMES = 40


class RunList(OptionList):
    """The runs of the runs folder, read in a thread."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._runs: dict[str, Recent] = {}
        self._folder = RunsFolder(runs_folder())

    def run_of(self, option_id: str | None) -> Recent:
        return self._runs[option_id or ""]

    @work(thread=True, group="runs", exclusive=True)
    def read(self) -> None:
        runs = self._folder.look(most=SHOWN)
        call_if_open(self, self._show, runs)

    def on_focus(self) -> None:
        """The cursor is on the newest run, so that enter opens something."""
        if self.highlighted is None and self._runs:
            self.highlighted = 0

    def _show(self, runs: list[Recent]) -> None:
        self._runs = {str(run.path): run for run in runs}
        self.clear_options()
        for run in runs:
            text = Text(f"{run.sign} {plain(run.path.stem)}", no_wrap=True, overflow="ellipsis")
            self.add_option(Option(text.append(f"  {run.brief}", "dim"), id=str(run.path)))
        if not runs:
            self.add_option(Option(Text("none yet", "dim"), disabled=True))


def about(run: Recent) -> Text:
    text = Text(plain(run.path.stem), "bold").append(
        f"\n{plain(run.trouble)}" if run.trouble else "", "not bold"
    )
    if run.trouble:
        return text
    text.append(
        f"\n{run.sign} {run.state_words}{f'; {plain(run.reason)}' if run.reason else ''}",
        "not bold",
    )
    text.append(f"\n{plain(run.scenario)} by {plain(run.algorithm)}, {plain(run.pair)}", "not bold")
    text.append(
        f"\n{brief(run.computed)} of simulations, {count(run.decisions, 'decision')} by hand",
        "not bold",
    )
    left = first_of([plain(name) for name in run.kept], MOST_NAMES)
    return text.append(
        f"\n{len(run.kept)} of {count(run.total, 'model')} left: {left}", "not bold dim"
    )


# All columns but the name, which takes the rest: title, width, whether it is a number, and its
# text.
_Column = tuple[str, int, bool, Callable[[Recent], str]]
FIRST: tuple[_Column, ...] = (
    ("state", 16, False, lambda run: f"{run.sign} {run.state_words}"),
    ("left", 10, True, lambda run: run.brief),
    ("tests", 6, True, lambda run: str(run.tests) if run.total else ""),
    ("cost", 7, True, lambda run: brief(run.computed) if run.total else ""),
)
# Columns are added in this order while they fit.
MORE: tuple[_Column, ...] = (
    ("changed", 11, True, lambda run: moment(run.changed)),
    ("scenario", 16, False, lambda run: plain(run.scenario)),
)
# By what the runs are sorted, in the order in which a key goes through it. Numbers and times begin
# with the most.
ORDERS: dict[str, Callable[[Recent], Any]] = {
    "changed": lambda run: -run.changed,
    "name": lambda run: run.path.stem.casefold(),
    "state": lambda run: run.state_words,
    "scenario": lambda run: run.scenario.casefold(),
    "left": lambda run: len(run.kept) if run.total else math.inf,
    "tests": lambda run: -run.tests,
    "cost": lambda run: -run.computed,
}
NARROWEST_NAME = 12
# Each column has a space at both sides of its text.
AROUND = 2


def moment(time: float) -> str:
    """A Unix time, s: the time of day if it is today, else the date."""
    if not time:
        return ""
    try:
        then = datetime.fromtimestamp(time)
        today = datetime.fromtimestamp(poll.now()).date()
    except (ValueError, OverflowError, OSError):
        # File systems allow years beyond the calendar.
        return "?"
    if then.date() == today:
        return f"{then:%H:%M:%S}"
    return f"{then.day} {then:%b %Y}"


class RunTable(DataTable[Text]):
    """One row per run; only changed rows are drawn again."""

    BINDINGS: ClassVar = keys(
        "runs",
        ("open", "enter", "select_cursor", "open", "open the run under the cursor"),
        ("first", "home", "scroll_top", "first", "to the first run"),
        ("last", "end", "scroll_bottom", "last", "to the last run"),
    )

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, cursor_type="row", zebra_stripes=False)
        self._runs: list[Recent] = []
        self._wide = 0
        self._order = ""
        self._shown: list[_Column] = []

    @property
    def chosen(self) -> Recent | None:
        if 0 <= self.cursor_row < len(self._runs):
            return self._runs[self.cursor_row]
        return None

    @property
    def _followed(self) -> Recent | None:
        """The run on which the cursor stays. While runs are first read, their order changes: a
        cursor at the top stays there.
        """
        is_reading = any(not run.status and not run.trouble for run in self._runs)
        if is_reading and self.cursor_row == 0:
            return None
        return self.chosen

    def show(self, runs: list[Recent], order: str) -> None:
        """Shows these in this order, whose column is marked; the cursor stays on its run."""
        before = self._runs
        paths = [run.path for run in runs]
        followed = self._followed
        self._runs = list(runs)
        if (self._wide, self._order) == (self.size.width, order) and paths == [
            run.path for run in before
        ]:
            for was, run in zip(before, runs, strict=True):
                if run != was:
                    for column, cell in zip(self.ordered_columns, self._row(run), strict=True):
                        self.update_cell(str(run.path), column.key, cell)
            return
        self._wide = self.size.width
        self._order = order
        self.clear(columns=True)
        room = self._wide - sum(width + AROUND for _, width, *_ in FIRST) - AROUND - 1
        self._shown = list(FIRST)
        for more in MORE:
            if room - more[1] - AROUND >= NARROWEST_NAME:
                self._shown.append(more)
                room -= more[1] + AROUND
        self._shown.insert(
            0, ("name", max(NARROWEST_NAME, room), False, lambda run: plain(run.path.stem))
        )
        for name, width, number, _ in self._shown:
            title = f"▾{name}" if name == order else name
            self.add_column(
                Text(title, justify="right" if number else "left"), width=width, key=name
            )
        for run in runs:
            self.add_row(*self._row(run), key=str(run.path))
        if followed is not None and followed.path in paths:
            self.move_cursor(row=paths.index(followed.path), animate=False)

    def on_resize(self) -> None:
        self.show(self._runs, self._order)

    def _row(self, run: Recent) -> list[Text]:
        return [
            Text(shortened(say(run), width), justify="right" if number else "left", no_wrap=True)
            for _, width, number, say in self._shown
        ]
