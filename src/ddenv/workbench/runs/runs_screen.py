"""The runs screen: every run of the runs folder, its state, and actions on it."""

from __future__ import annotations

import shutil
import time
from asyncio import to_thread
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.containers import Horizontal, VerticalScroll
from textual.screen import Screen
from textual.widgets import DataTable, Input, Static

from ddenv.errors import UserError
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import LOGS
from ddenv.runs.comparison import compared
from ddenv.runs.folder import SUFFIX, dropped_run, find_run, runs_folder
from ddenv.runs.recent import Recent
from ddenv.text import count, plain, shortened
from ddenv.workbench.help.dialogs import SideBySide
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.runs.recent_runs import RunsFolder
from ddenv.workbench.runs.runs_table import ORDERS, RunTable, about
from ddenv.workbench.shared.background import call_if_open, is_open, refuse
from ddenv.workbench.shared.bindings import HELP, ids, keys
from ddenv.workbench.shared.messages import ShowRun, ShowSetup
from ddenv.workbench.widgets.path_entry import PathEntry

FOLDER = ".deleted"
# The endings of files beside a run file that go with it.
BESIDE = (*LOGS, ".log", ".scene.log", ".place")
# How long a deleted run is kept, s.
KEPT = 7 * 86_400.0
# The time between two reads of the folder, and the maximum time of a read before it shows its first
# results, s.
PERIOD = 1.0
PATIENCE = 0.3
# The footer's keys by priority.
FIRST = ids("runs", "help back open sort filter delete undo mark compare path watch like")


def delete_run(path: Path) -> None:
    """Moves a run and the files beside it to the deleted ones; those that were deleted a week ago
    are gone for good.

    Raises UserError while an engine works on it, or if it cannot be moved.
    """
    with engine_lock(path):
        for old in _places(path.parent):
            if int(old.name) / 1e9 < time.time() - KEPT:
                shutil.rmtree(old, ignore_errors=True)
        place = path.parent / FOLDER / f"{time.time_ns()}"
        try:
            place.mkdir(parents=True)
            for each in (path, *(path.with_name(f"{path.name}{ending}") for ending in BESIDE)):
                if each.exists():
                    each.rename(place / each.name)
            path.with_name(f"{path.name}.lock").unlink(missing_ok=True)
        except OSError as error:
            raise UserError(f"{path}: cannot be deleted: {error.strerror}") from None


def bring_back(folder: Path) -> Path:
    """Brings back the run of `folder` that was deleted last. Raises UserError if there is none, or
    if its name is taken.
    """
    for place in sorted(_places(folder), reverse=True):
        run = next(place.glob(f"*{SUFFIX}"), None)
        if run is None:
            continue
        path = folder / run.name
        if path.exists():
            raise UserError(
                f"{path.stem}: there is a new run of this name; delete or rename that one first"
            )
        try:
            # The run comes last: without its log it would lack its last events.
            for each in sorted(place.iterdir(), key=lambda each: each == run):
                each.rename(folder / each.name)
            place.rmdir()
        except OSError as error:
            raise UserError(f"{path}: cannot be brought back: {error.strerror}") from None
        return path
    raise UserError("there is no deleted run to bring back")


def _places(folder: Path) -> list[Path]:
    """A folder for each deletion, named by its time in ns."""
    home = folder / FOLDER
    if home.is_dir():
        return [each for each in home.iterdir() if each.name.isdecimal()]
    return []


class RunsScreen(Screen[None]):
    """Reads the folder repeatedly in a thread; writes only on the user's command."""

    CSS_PATH = "runs.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (64, "-narrow"), (110, "-wide"), (160, "-huge")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (12, "-short"), (20, "-low"), (30, "-tall")]
    BINDINGS: ClassVar = keys(
        "runs",
        ("watch", "w", "open(True)", "watch", "watch it without changing anything"),
        ("like", "n", "copy", "new like it", "a new run with its scenario and other settings"),
        ("filter", "slash", "filter", "filter", "filter by name, scenario, method or state"),
        ("sort", "s", "sort", "sort", "sort by the next column; or click on a column"),
        ("mark", "m", "mark", "mark", "mark this run, to compare another with it"),
        ("compare", "c", "compare", "compare", "compare the marked run with this one"),
        ("delete", "d", "delete", "delete", "delete it; u brings it back for a week"),
        ("undo", "u", "undo", "undo", "bring back the run that was deleted last"),
        (
            "path",
            "o",
            "path",
            "open a file",
            "open a run by its path; or drop the file on the terminal",
        ),
        HELP,
        ("back", "escape,q,R", "back", "back", "back to the previous screen", "esc"),
    )

    def __init__(self) -> None:
        super().__init__()
        self._folder = RunsFolder(runs_folder())
        self._runs: list[Recent] = []
        self._reading = False
        self._order = next(iter(ORDERS))
        self._marked: Path | None = None

    def compose(self) -> ComposeResult:
        with Horizontal(id="body"):
            with Framed("Runs", id="list", classes="panel"):
                yield RunTable(id="table")
                yield Static("reading ...", id="empty", markup=False)
                yield Input(
                    placeholder="a part of name, scenario, method or state",
                    id="filter",
                    compact=True,
                )
                yield PathEntry(placeholder="path of a run file (.ddenv); tab completes", id="path")
            with VerticalScroll(id="preview", classes="panel", can_focus=False) as panel:
                panel.border_title = "This run"
                yield Static("", id="about", markup=False)
        yield KeyFooter(FIRST)
        yield Static("Please make the terminal larger: at least 64 x 12.", id="small", markup=False)

    def on_mount(self) -> None:
        self.query_one(RunTable).focus()
        self._look()
        self.set_interval(PERIOD, self._look)

    def _look(self) -> None:
        if not self._reading:
            self._reading = True
            self._read()

    @work(thread=True, group="runs")
    def _read(self) -> None:
        runs = self._folder.look(PATIENCE)

        def show() -> None:
            self._reading = False
            self._runs = runs
            self._list()
            # The rest is read at once.
            if any(not run.status and not run.trouble for run in runs):
                self.set_timer(0.05, self._look)

        call_if_open(self, show)

    def _list(self) -> None:
        part = self.query_one("#filter", Input).value
        wanted = part.strip().casefold()
        said = (
            (run, (run.path.stem, run.scenario, run.pair, run.algorithm, run.state_words))
            for run in self._runs
        )
        found = (run for run, words in said if any(wanted in each.casefold() for each in words))
        shown = sorted(found, key=ORDERS[self._order])
        table = self.query_one(RunTable)
        table.show(shown, self._order)
        table.display = bool(shown)
        empty = self.query_one("#empty", Static)
        empty.display = not shown
        nothing = (
            f"No runs yet in {runs_folder()}.\n\nescape goes back to make one, or type: ddenv "
            "run ditch"
        )
        if self._runs:
            nothing = (
                f"No run has '{plain(part)}' in its name, scenario, method or state; escape "
                "shows all."
            )
        empty.update(Text(nothing))
        works = sum(run.is_worked_on for run in self._runs)
        panel = self.query_one("#list")
        panel.border_title = Text(
            f"Runs: {len(shown)} of {len(self._runs)}" if part else f"Runs: {len(self._runs)}"
        )
        now = [f"{count(works, 'engine')} running"] if works else []
        if self._marked is not None:
            now.append(f"marked: {shortened(plain(self._marked.stem), 20)}")
        panel.border_subtitle = Text(" · ".join(now))
        self._show_title()

    @on(DataTable.RowHighlighted)
    def _show_title(self) -> None:
        run = self._chosen
        self.query_one("#about", Static).update("" if run is None else about(run))

    @property
    def _chosen(self) -> Recent | None:
        return self.query_one(RunTable).chosen

    @on(DataTable.RowSelected)
    def _selected(self) -> None:
        self.action_open(watch=False)

    def action_open(self, watch: bool) -> None:
        if (run := self._readable()) is not None:
            self.post_message(ShowRun(run.path, watch))

    def action_copy(self) -> None:
        if (run := self._readable()) is not None:
            self.post_message(ShowSetup(like=run.path))

    def _readable(self) -> Recent | None:
        run = self._chosen
        if run is None:
            refuse(self, "there is no run here")
        elif run.trouble:
            refuse(self, run.trouble)
        else:
            return run
        return None

    def action_delete(self) -> None:
        run = self._chosen
        if run is None:
            refuse(self, "there is no run here")
        elif run.is_worked_on:
            refuse(self, "its engine is running: open the run and stop it first")
        else:
            said = "is deleted; u brings it back, for a week"
            self.app.run_worker(self._change(delete_run, run.path, said))

    def action_undo(self) -> None:
        self.app.run_worker(self._change(bring_back, runs_folder(), "is back"))

    async def _change(self, change: Callable[[Path], Path | None], path: Path, said: str) -> None:
        try:
            run = await to_thread(change, path) or path
        except UserError as error:
            refuse(self, str(error))
            return
        self.notify(f"{plain(run.stem)} {said}", timeout=4, markup=False)
        self._runs = [each for each in self._runs if each.path != path]
        if is_open(self):
            self._list()
            self._look()

    def action_sort(self) -> None:
        names = list(ORDERS)
        self._sort(names[(names.index(self._order) + 1) % len(names)])

    @on(DataTable.HeaderSelected)
    def _header_clicked(self, event: DataTable.HeaderSelected) -> None:
        self._sort(str(event.column_key.value))

    def _sort(self, order: str) -> None:
        self._order = order
        self._list()

    def action_mark(self) -> None:
        run = self._chosen
        self._marked = None if run is None or run.path == self._marked else run.path
        self._list()

    def action_compare(self) -> None:
        marked = next((run for run in self._runs if run.path == self._marked), None)
        if marked is None:
            refuse(self, "mark a run first (m), then go to another one and press c")
        elif (run := self._readable()) is not None:
            if run.path == marked.path:
                refuse(self, "this is the marked run: go to another one")
            else:
                self.app.push_screen(SideBySide("Two runs side by side", compared(marked, run)))

    def action_path(self) -> None:
        self.add_class("-opening")
        self.query_one("#path").focus()

    @on(Input.Submitted, "#path")
    def _path_entered(self, event: Input.Submitted) -> None:
        words = event.value.strip()
        path = dropped_run(words) or find_run(words)
        if words and path.is_file():
            self.post_message(ShowRun(path))
        elif words:
            refuse(self, f"{plain(path)}: no such run file")

    def action_filter(self) -> None:
        self.add_class("-filtering")
        self.query_one("#filter").focus()

    @on(Input.Changed, "#filter")
    def _filtered(self) -> None:
        self._list()

    @on(Input.Submitted, "#filter")
    def _taken(self, event: Input.Submitted) -> None:
        self.set_class(bool(event.value), "-filtering")
        self.query_one(RunTable).focus()

    def action_back(self) -> None:
        if self.has_class("-opening"):
            self.remove_class("-opening")
        elif self.has_class("-filtering"):
            self.remove_class("-filtering")
            self.query_one("#filter", Input).value = ""
        else:
            self.dismiss()
            return
        self.query_one(RunTable).focus()
