"""The history of a run: the tree of its reductions, the user's decisions, and two environments side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, Literal

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen, Screen
from textual.widgets import DataTable, Static

from ddenv.guiding.commands import question, refusal
from ddenv.guiding.course import GoBack
from ddenv.guiding.situation import Situation
from ddenv.runfile import branches
from ddenv.runfile.fold_decisions import place
from ddenv.runfile.progress import Node
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState
from ddenv.text import count, first_of, plain, shortened
from ddenv.words.claims import of_runs, seen
from ddenv.words.decisions import CAME_BY
from ddenv.words.slices import slice_in_short
from ddenv.workbench.help.bindings import HELP, ids, keys
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.map.place import Place
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.log import NOTHING_DECIDED, as_it_is, decision_lines
from ddenv.workbench.widgets.lines import Lines
from ddenv.workbench.widgets.question import Question

# Time between two looks at the run, s.
PERIOD = 0.5
# Name and width of the columns after the tree; the last is for wide terminals.
COLUMNS = (("#", 3), ("made by", 15), ("at test", 7), ("f shown", 10), ("", 14), ("method", 36))
ROOM = 90
# The width of the tree in columns, without the lines of its branches.
TREE = 15
MARK = "marked"
GO = "go on from this environment: the run pauses there (branch)"


class Tree(DataTable[Text]):
    """The cursor is a whole row: home and end go to the first and the last one."""

    def action_scroll_home(self) -> None:
        self.action_scroll_top()

    def action_scroll_end(self) -> None:
        self.action_scroll_bottom()


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

    def __init__(self, look: Callable[[], Situation], place: Place) -> None:
        """`look` returns the run as it is now."""
        super().__init__()
        self._look_at, self._place = look, place
        self._tree: tuple[Node, ...] = ()
        self._here = -1
        self._rows: list[branches.Row] = []
        self._marked: int | None = None

    def compose(self) -> ComposeResult:
        with Horizontal(id="both"):
            with Framed("Reductions", id="tree-panel", classes="panel"):
                yield Tree(id="tree", cursor_type="row", cell_padding=1)
            with Framed("What you decided", id="past-decisions", classes="panel"):
                yield Lines(as_it_is, nothing=NOTHING_DECIDED, tail=True, parts=decision_lines, id="decisions")
        yield Static("", id="about", markup=False)
        shown = ids("history", "go mark compare help close")
        yield KeyFooter(shown, shown)

    def on_mount(self) -> None:
        self.query_one(Tree).focus()
        self.set_interval(PERIOD, self._look)

    # What is shown.

    def _look(self) -> None:
        state = self._look_at().state
        if state.decisions != (lines := self.query_one(Lines)).items:
            lines.show(state.decisions)
        if (state.nodes, state.node) != (self._tree, self._here):
            at = self.under_cursor
            stays = None if at is None or at.number == self._here else at.number
            self._tree, self._here = state.nodes, state.node
            self._rows = branches.rows(state.nodes, state.node)
            self._fill(self._here if stays is None else stays)

    def _fill(self, cursor: int) -> None:
        table = self.query_one(Tree)
        table.clear(columns=True)
        branched = max((len(row.lines) for row in self._rows), default=0)
        table.add_column("environment", width=TREE + min(branched, 20))
        for name, width in COLUMNS if table.size.width >= ROOM else COLUMNS[:-1]:
            table.add_column(Text(name, justify=_side(name)), width=width)
        for row in self._rows:
            table.add_row(*self._cells(row)[: len(table.columns)])
        place = next((place for place, row in enumerate(self._rows) if row.node.number == cursor), 0)
        table.move_cursor(row=place)
        self._show_about()

    def _cells(self, row: branches.Row) -> tuple[Text, ...]:
        node = row.node
        here = node.number == self._here
        style = "bold" if here else "dim" if node.rejected or node.lost_rate else ""
        sign = branches.sign(node, self._here)
        size = len(node.environment)
        marked = MARK if node.number == self._marked else ""
        words = ", ".join(part for part in (marked, branches.words(node, self._here)) if part)
        texts = (str(node.number), plain(node.what), str(node.tests), seen(node), words, plain(node.method))
        cells = (
            Text(text, style, justify=_side(name), no_wrap=True) for text, (name, _) in zip(texts, COLUMNS, strict=True)
        )
        return Text(f"{row.lines}{sign} {count(size, 'model')}", style, no_wrap=True), *cells

    @property
    def under_cursor(self) -> Node | None:
        row = self.query_one(Tree).cursor_row
        return self._rows[row].node if 0 <= row < len(self._rows) else None

    def on_resize(self) -> None:
        self.call_after_refresh(self._arrange)

    def _arrange(self) -> None:
        at = self.under_cursor
        if at is None:
            self._look()
        else:
            self._fill(at.number)

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

    # What is done.

    def action_go(self) -> None:
        node = self.under_cursor
        if node is None:
            return
        now, command = self._look_at(), GoBack(node.number)
        if why := refusal(command, now):
            self._refuse(why)
            return

        def answered(yes: bool | None) -> None:
            if yes:
                self.dismiss(node.number)

        self.app.push_screen(Question(question(command, now.state)), answered)

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
            self._refuse("mark one environment first (m), then move to another and press c")
        elif node.number == self._marked:
            self._refuse("this one is marked: move to another one")
        else:
            first = self._tree[self._marked]
            self.app.push_screen(Compare(first, node, self._look_at().state, self._place))

    def _refuse(self, why: str) -> None:
        self.notify(why, severity="warning", timeout=4, markup=False)


def _side(name: str) -> Literal["left", "right"]:
    return "right" if name in ("#", "tests", "f shown") else "left"


def compare(first: Node, second: Node) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """The models of both environments, those of the first alone, and those of the second, in the order of the world file."""
    left, right = frozenset(first.environment), frozenset(second.environment)
    return (
        tuple(name for name in first.environment if name in right),
        tuple(name for name in first.environment if name not in right),
        tuple(name for name in second.environment if name not in left),
    )


class Compare(ModalScreen[None]):
    """Facts, maps if there is room, and the models: those in both, and those in only one."""

    CSS_PATH = "history.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-small"), (110, "-large")]
    AUTO_FOCUS = "Lines"
    BINDINGS: ClassVar = keys("compare", ("close", "escape,c,q,enter", "dismiss", "close", "back to the history"))

    def __init__(self, first: Node, second: Node, state: RunState, place: Place) -> None:
        super().__init__()
        self._common, *alone = compare(first, second)
        self._sides = tuple(zip("AB", (first, second), alone, strict=True))
        self._state, self._place = state, place

    def compose(self) -> ComposeResult:
        with Framed("Two environments side by side", "tab to the lists   escape closes"):
            with Horizontal(classes="sides"):
                for name, node, alone in self._sides:
                    with Vertical(classes="side"):
                        yield Static(self._facts(name, node), classes="facts", markup=False)
                        yield WorldMap(id=f"map-{name}")
                        yield Static(_heading(f"only in {name}", alone), classes="facts", markup=False)
                        yield Lines(_name, nothing="none", id=f"only-{name}")
            yield Static(_heading("in both", self._common), classes="facts", markup=False)
            yield Lines(_name, nothing="none", id="common")

    def on_mount(self) -> None:
        for name, node, alone in self._sides:
            self.query_one(f"#only-{name}", Lines).show(alone)
            world = self.query_one(f"#map-{name}", WorldMap)
            world.set_place(self._place)
            world.show(Snapshot(self._state.changed(environment=node.environment, round=None, trials=())), None)
        self.query_one("#common", Lines).show(self._common)

    def on_resize(self) -> None:
        # Of one size, so that both maps have one scale and one frame.
        both = self.query_one(".sides").content_size.width or self.size.width
        for side in self.query(".side"):
            side.styles.width = both // 2

    def _facts(self, name: str, node: Node) -> Text:
        words = branches.words(node, self._state.node)
        text = Text(f"{name}  {place(node)}", "bold").append(f"\n{plain(node.method)}", "not bold")
        after = f"\n{count(node.own_tests, 'own test')}"
        return text.append(after + (f"; {words}" if words else ""), "not bold dim")


def _heading(what: str, names: Sequence[str]) -> Text:
    return Text(f"{what}: {count(len(names), 'model')}", "bold")


def _name(name: str, width: int) -> Text:
    return Text(f"  {shortened(name, max(4, width - 2))}", no_wrap=True)
