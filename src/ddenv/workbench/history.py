"""The history of a run: the tree of its reductions, the user's decisions, and two environments side
by side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.screen import Screen
from textual.widgets import DataTable, Static

from ddenv.guiding.commands import Context, GoBack, question, refusal
from ddenv.runfile import branches
from ddenv.runfile.fold_decisions import place
from ddenv.runfile.progress import Node
from ddenv.text import count, first_of, plain, shortened
from ddenv.words.claims import of_runs, seen
from ddenv.words.signs import CAME_BY
from ddenv.words.slices import slice_in_short
from ddenv.workbench.help.dialogs import SideBySide
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.background import refuse
from ddenv.workbench.shared.bindings import HELP, ids, keys
from ddenv.workbench.shared.log import NOTHING_DECIDED, as_it_is, decision_lines
from ddenv.workbench.widgets.lines import Lines
from ddenv.workbench.widgets.question import ask

# Time between two looks at the run, s.
PERIOD = 0.5
COLUMNS = ("environment", "#", "made by", "at test", "f shown", " ")
# The maximum number of models that are named.
NAMED = 40
GO = "go on from this environment: the run pauses there (branch)"


class Tree(DataTable[Text]):
    """Home and end go to the first and the last row."""

    action_scroll_home = DataTable.action_scroll_top
    action_scroll_end = DataTable.action_scroll_bottom


class History(Screen[int | None]):
    """Returns the node to go on from, or None. It follows the run while it is open."""

    CSS_PATH: ClassVar = ["history.tcss"]
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-wide"), (170, "-huge")]
    BINDINGS: ClassVar = [
        *keys("history", ("go", "enter", "go", "go on from here", GO), priority=True),
        *keys(
            "history",
            ("mark", "m", "mark", "mark", "mark this environment, to compare another with it"),
            ("compare", "c", "compare", "compare", "compare the marked environment with this one"),
            HELP,
            ("close", "escape,h,q", "dismiss(None)", "close", "back to the run", "esc"),
        ),
    ]

    def __init__(self, look: Callable[[], Context]) -> None:
        """`look` returns the run as it is now."""
        super().__init__()
        self._look_at = look
        self._tree: tuple[Node, ...] = ()
        self._here = -1
        self._rows: list[branches.Row] = []
        self._marked: int | None = None

    def compose(self) -> ComposeResult:
        with Horizontal(id="both"):
            with Framed("Reductions", id="tree-panel", classes="panel"):
                yield Tree(id="tree", cursor_type="row", cell_padding=1)
            with Framed("What you decided", id="past-decisions", classes="panel"):
                yield Lines(
                    as_it_is,
                    nothing=NOTHING_DECIDED,
                    tail=True,
                    parts=decision_lines,
                    id="decisions",
                )
        yield Static("", id="about", markup=False)
        yield KeyFooter(ids("history", "help close go mark compare"))

    def on_mount(self) -> None:
        table = self.query_one(DataTable)
        table.add_columns(*COLUMNS)
        table.focus()
        self._look()
        self.set_interval(PERIOD, self._look)

    def _look(self) -> None:
        state = self._look_at().state
        if state.decisions != (lines := self.query_one(Lines)).items:
            lines.show(state.decisions)
        if (state.nodes, state.node) != (self._tree, self._here):
            at = self.under_cursor
            stays = None if at is None or at.number == self._here else at.number
            self._tree = state.nodes
            self._here = state.node
            self._rows = branches.rows(state.nodes, state.node)
            self._fill(self._here if stays is None else stays)

    def _fill(self, cursor: int) -> None:
        table = self.query_one(DataTable)
        table.clear()
        for row in self._rows:
            node = row.node
            here = self._here
            if node.number == here:
                style = "bold"
            elif node.rejected or node.lost_rate:
                style = "dim"
            else:
                style = ""
            size = f"{row.lines}{branches.sign(node, here)} {count(len(node.environment), 'model')}"
            marked = "marked" if node.number == self._marked else ""
            words = ", ".join(filter(None, (marked, branches.words(node, here))))
            cells = (size, str(node.number), plain(node.what), str(node.tests), seen(node), words)
            table.add_row(*(Text(text, style) for text in cells))
        table.move_cursor(
            row=next(
                (place for place, row in enumerate(self._rows) if row.node.number == cursor), 0
            )
        )
        self._show_about()

    @property
    def under_cursor(self) -> Node | None:
        row = self.query_one(DataTable).cursor_row
        if 0 <= row < len(self._rows):
            return self._rows[row].node
        return None

    def on_data_table_row_highlighted(self) -> None:
        self._show_about()

    def _show_about(self) -> None:
        node = self.under_cursor
        if node is None:
            return
        names = first_of([plain(shortened(name, 40)) for name in node.environment], 12)
        text = Text(f"{place(node)}: {CAME_BY[node.how][1]}", "bold")
        text.append(f", f in {of_runs(node.shown, len(node.runs))}" if node.runs else "")
        text.append(f", by {plain(node.method)}" if node.method else "", "not bold")
        sliced = f"\n{slice_in_short(self._look_at().state, node)}" if node.how == "sliced" else ""
        text.append(f"{sliced}\n{names or 'no models'}", "not bold dim")
        self.query_one("#about", Static).update(text)

    def action_go(self) -> None:
        node = self.under_cursor
        if node is None:
            return
        now = self._look_at()
        command = GoBack(node.number)
        if why := refusal(command, now):
            refuse(self, why)
            return
        ask(self.app, question(command, now.state), lambda: self.dismiss(node.number))

    def action_mark(self) -> None:
        node = self.under_cursor
        if node is None:
            return
        self._marked = None if self._marked == node.number else node.number
        self._fill(node.number)
        if self._marked is not None:
            self.notify("marked; c compares another one with it", timeout=3)

    def action_compare(self) -> None:
        node = self.under_cursor
        if node is None or self._marked is None:
            refuse(self, "mark one environment first (m), then move to another and press c")
        elif node.number == self._marked:
            refuse(self, "this is the marked one: move to another one")
        else:
            first = self._tree[self._marked]
            self.app.push_screen(
                SideBySide("Two environments side by side", lines(first, node, self._here))
            )


def lines(first: Node, second: Node, here: int) -> Iterator[tuple[str, str, str]]:
    yield "environment", place(first), place(second)
    yield "method", plain(first.method), plain(second.method)
    yield "own tests", str(first.own_tests), str(second.own_tests)
    yield "in the run", branches.words(first, here), branches.words(second, here)
    left = frozenset(first.environment)
    right = frozenset(second.environment)
    common = _named([name for name in first.environment if name in right])
    yield "in both", common, common
    alone = [
        _named([name for name in node.environment if name not in left & right])
        for node in (first, second)
    ]
    yield "only in this one", alone[0], alone[1]


def _named(names: Sequence[str]) -> str:
    if names:
        return f"{len(names)}: {first_of([plain(shortened(name, 40)) for name in names], NAMED)}"
    return "none"
