"""The table of this round's candidates, of the baseline's runs before the first round, or of the full runs after the last."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text
from textual.message import Message
from textual.widgets import DataTable

from ddenv.map.names import shortened
from ddenv.runfile.state import Candidate, Test
from ddenv.workbench.poll import Snapshot
from ddenv.workbench.settings import settings
from ddenv.workbench.wording import VERDICT, metres, outcome, plain

# Name, width in cells with the space between columns, and whether it stays when there is little room.
COLUMNS = (
    ("#", 3, True),
    ("candidate", 11, True),
    ("models", 6, True),
    ("distance", 10, False),
    ("tests", 7, True),
    ("verdict", 15, True),
)
# Of a model's name so many columns, behind a sign and a space.
NAME = 8
# By row key, then by column.
Rows = dict[str, dict[str, str]]
RIGHT = ("models", "distance", "tests")


class Candidates(DataTable):
    """Rows are updated by key, a cell only when it changed. The cursor follows the run until it is moved by hand."""

    class Chosen(Message):
        """The cursor was moved by hand, or given back to the run."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id, cursor_type="row", cell_padding=0)
        self.following = True
        self._of: tuple = ()
        self._names: tuple[str, ...] = ()
        self._cells: Rows = {}
        self._round: Sequence[Candidate] = ()

    def on_mount(self) -> None:
        self.set_narrow(False)

    def set_narrow(self, narrow: bool) -> None:
        """With little room the distance is left out."""
        names = tuple(name for name, _, stays in COLUMNS if stays or not narrow)
        if names == self._names:
            return
        row, rows = self.cursor_row, self._cells
        self.clear(columns=True)
        self._names, self._cells = names, {}
        for name, width, _ in COLUMNS:
            if name in names:
                self.add_column(_cell(name, name), width=width, key=name)
        self._fill(self._of, rows)
        self.move_cursor(row=row)

    @property
    def chosen(self) -> Candidate | None:
        """The candidate that was chosen by hand."""
        return None if self.following else self.under_cursor

    @property
    def under_cursor(self) -> Candidate | None:
        row = self.cursor_row
        return self._round[row] if 0 <= row < len(self._round) else None

    def show(self, snapshot: Snapshot) -> None:
        state, current = snapshot.state, snapshot.state.round
        if state.confirming and not state.ended:
            self._round = ()
            self._fill(("confirm",), _confirm(snapshot))
            return
        self._round = current.candidates if current else ()
        rows = _candidates(snapshot) if current else _baseline(snapshot)
        self._fill(("round", current.number) if current else ("baseline",), rows)
        focus = snapshot.focus
        if self.following and focus is not None and self.cursor_row != focus.index:
            self.move_cursor(row=focus.index)

    def _fill(self, of: tuple, rows: Rows) -> None:
        if of != self._of or any(key not in rows for key in self._cells):
            self.clear()
            self._of, self._cells, self.following = of, {}, True
        for key, cells in rows.items():
            if key not in self._cells:
                self.add_row(*(_cell(cells[name], name) for name in self._names), key=key)
            else:
                self._update(key, cells)
        self._cells = rows

    def _update(self, key: str, cells: dict[str, str]) -> None:
        for name in self._names:
            if cells[name] != self._cells[key][name]:
                self.update_cell(key, name, _cell(cells[name], name))

    def follow(self) -> None:
        """Gives the cursor back to the run."""
        self.following = True
        self.post_message(self.Chosen())

    def _by_hand(self) -> None:
        self.following = False
        self.post_message(self.Chosen())

    def action_cursor_up(self) -> None:
        super().action_cursor_up()
        self._by_hand()

    def action_cursor_down(self) -> None:
        super().action_cursor_down()
        self._by_hand()

    def action_page_up(self) -> None:
        super().action_page_up()
        self._by_hand()

    def action_page_down(self) -> None:
        super().action_page_down()
        self._by_hand()

    # With a cursor of whole rows, home and end mean the first and the last candidate.

    def action_scroll_home(self) -> None:
        self.action_scroll_top()

    def action_scroll_end(self) -> None:
        self.action_scroll_bottom()

    def action_scroll_top(self) -> None:
        super().action_scroll_top()
        self._by_hand()

    def action_scroll_bottom(self) -> None:
        super().action_scroll_bottom()
        self._by_hand()

    def on_data_table_row_selected(self, event: DataTable.RowSelected) -> None:
        event.stop()
        self._by_hand()


def _cell(words: str, name: str) -> Text:
    style = "bold" if words.startswith(("●", "▶", "?")) else "dim" if words.startswith(("○", "⊘")) else ""
    if name == "verdict":
        words = f"  {words}"
    return Text(words, style, justify="right" if name in RIGHT else "left", no_wrap=True)


def _candidates(snapshot: Snapshot) -> Rows:
    full = 1 + settings(snapshot.state).iterations
    return {str(each.index): _candidate(snapshot, each, full) for each in snapshot.state.round.candidates}


def _candidate(snapshot: Snapshot, each: Candidate, full: int) -> dict[str, str]:
    tests = [snapshot.state.tests[id - 1] for id in each.tests if 0 < id <= len(snapshot.state.tests)]
    done = sum(test.is_finished for test in tests)
    verdict = VERDICT.get(each.verdict, plain(each.verdict)) or _open(snapshot, tests)
    if snapshot.state.waiting_candidate == each.index:
        verdict = "? a or x"
    ran = f"{done}/{full}" if done or any(test.outcome == "running" for test in tests) else ""
    return _row(str(each.index + 1), each.label, str(each.size), metres(each.distance), ran, verdict)


def _open(snapshot: Snapshot, tests: list[Test]) -> str:
    running = [test for test in tests if test.outcome == "running"]
    if not running or snapshot.engine != "alive":
        return ""
    return "▶" * min(3, len(running)) + _seconds(snapshot, running[0])


def _seconds(snapshot: Snapshot, test: Test) -> str:
    seconds = snapshot.seconds(test.id)
    return "" if seconds is None else f" {seconds:.1f} s"


def _baseline(snapshot: Snapshot) -> Rows:
    rows = {}
    for test in snapshot.state.tests:
        models = str(len(snapshot.state.elements))
        words = f"run {test.run + 1}", models, metres(test.distance), "", _ended(snapshot, test)
        rows[f"t{test.id}"] = _row(str(test.id), *words)
    return rows


def _confirm(snapshot: Snapshot) -> Rows:
    rows = {}
    left = len(snapshot.state.environment)
    for number, test in enumerate(snapshot.state.confirm_tests, start=1):
        name = "all left" if test.without is None else f"- {shortened(test.without, NAME)}"
        models, run = left - (test.without is not None), f"run {test.run + 1}"
        rows[f"t{test.id}"] = _row(str(number), name, str(models), metres(test.distance), run, _ended(snapshot, test))
    return rows


def _ended(snapshot: Snapshot, test: Test) -> str:
    running = test.outcome == "running" and snapshot.engine == "alive"
    return f"▶{_seconds(snapshot, test)}" if running else outcome(test)


def _row(*words: str) -> dict[str, str]:
    return dict(zip((name for name, _, _ in COLUMNS), words, strict=True))
