"""Why the robot fails: what happens without each model that is left, and the nearest world that
passes, in words and on the map.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import Screen
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.guiding.commands import Isolate, Stop
from ddenv.runfile.position import Position
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.folder import attach_name
from ddenv.runs.playback import played
from ddenv.text import plain, shortened
from ddenv.words.claims import shape_doubts
from ddenv.words.margins import BAR_WORDS, bar, nearest_fix, rows, sureness
from ddenv.workbench.help.dialogs import Reading
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.map.map_words import MapLines
from ddenv.workbench.map.place import Place, Way, read_world
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.playback.playback_screen import Playback, way_of, without
from ddenv.workbench.shared.background import call_if_open, refuse
from ddenv.workbench.shared.bindings import HELP, MAP_KEYS, ids, keys
from ddenv.workbench.shared.observed import Observed
from ddenv.workbench.why.entries import (
    Entry,
    entries,
    head,
    head_of,
    listed,
    nothing_yet,
    remedy,
    said,
)

SMALLEST = (64, 18)
# Time between two looks at the run, s.
PERIOD = 0.5


FIRST = ids("why", "help close play isolate margins copy signs closer farther fit")


# What the key of isolation does, as the footer says.
BEGIN = "world that passes"
GO_ON = "go on"
STOP = "stop"


class WhyScreen(Screen[None]):
    """`look` says whether an engine works on the run, and the error that ended the last one, or "".
    `ask` starts and stops engines, or says why not; `place` is the run's world, if it is read
    already.
    """

    CSS_PATH = "why.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (SMALLEST[0], "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-low")]
    AUTO_FOCUS = "#why-list"
    BINDINGS: ClassVar = [
        *keys(
            "why",
            ("play", "enter", "play", "play both runs", "play both runs over each other"),
            priority=True,
        ),
        *keys(
            "why",
            (
                "isolate",
                "i",
                "isolate",
                BEGIN,
                "find a nearest world in which the robot reaches its goal; again: stop that",
            ),
            (
                "margins",
                "m",
                "margins",
                "margins",
                "how far each number can change before f disappears",
            ),
            (
                "copy",
                "c",
                "copy",
                "copy",
                "copy all sentences, or the command that is named (OSC 52)",
            ),
            *MAP_KEYS,
            ("signs", "k", "app.signs", "signs", "what the signs and letters on the map mean"),
            HELP,
            ("close", "escape,W,q", "dismiss", "close", "back to the run", "esc"),
        ),
    ]

    def __init__(
        self,
        file: RunFile,
        position: Position,
        place: Place,
        look: Callable[[], tuple[bool, str]],
        ask: Callable[[Isolate | Stop], None],
    ) -> None:
        super().__init__()
        self._file = file
        self._position = position
        self._place = place
        self._engine = look
        self._ask = ask
        self._seen: tuple[object, ...] = ()
        self._trouble = ""
        self._state = RunState()
        self._entries: tuple[Entry, ...] = ()
        self.map = WorldMap(id="why-map")

    def compose(self) -> ComposeResult:
        yield Static("", id="why-header", markup=False)
        with Horizontal(id="why-body"):
            with Vertical(id="why-left"):
                with Framed("Without each model", id="why-models", classes="panel"):
                    yield Static("", id="why-head", markup=False)
                    yield OptionList(id="why-list", compact=True, markup=False)
                with (
                    Framed("What happens", id="why-happens", classes="panel"),
                    VerticalScroll(id="why-scroll"),
                ):
                    yield Static("", id="why-said", markup=False)
            with Framed("World", id="why-world", classes="panel"):
                yield self.map
                yield MapLines(only_signs=True, id="why-legend")
        with VerticalScroll(id="why-nothing"):
            yield Static("", id="why-empty", markup=False)
        yield KeyFooter(FIRST)
        yield Static(f"ddenv needs {SMALLEST[0]} x {SMALLEST[1]}", id="small", markup=False)

    def on_mount(self) -> None:
        self._look()
        self.set_interval(PERIOD, self._look)
        if self._place.prints:
            self._placed(self._place, "")
        else:
            read_world(self, self._file.path, self._placed)

    def on_resize(self) -> None:
        self.call_after_refresh(self._list)

    def _placed(self, place: Place, notice: str) -> None:
        self._place = place
        self.map.set_place(place, notice)
        self._show_entry()

    def _look(self) -> None:
        """Reads all again once there is another certificate, or another nearest world that
        passes.
        """
        state = self._position.now
        (works, trouble) = self._engine()
        self.query_one("#why-header", Static).update(
            Text(f" {plain(head_of(state, works))}", no_wrap=True, overflow="ellipsis")
        )
        # What the key of isolation does.
        begun = state.isolating is not None
        known = state.isolated is not None
        does = "" if known else BEGIN
        if begun:
            does = STOP if works else GO_ON
        self.query_one(KeyFooter).say("why.isolate", does)
        if trouble and trouble != self._trouble:
            self.notify(plain(trouble), severity="error", markup=False)
        self._trouble = trouble
        # Margins are shown once their search is over.
        margins = state.margins if state.margining is None else None
        known = current(state) is not None or state.isolated is not None or margins is not None
        seen = (
            current(state),
            state.isolated,
            margins,
            works,
            state.status,
            0 if known else state.tests_done,
        )
        if seen == self._seen:
            return
        self._seen = seen
        self._state = state
        if known:
            self._read(state)
        else:
            self._found((), 0, "")

    @work(thread=True, group="why", exclusive=True)
    def _read(self, state: RunState) -> None:
        """Comparing the ways of many runs takes a while."""
        found: tuple[Entry, ...] = ()
        more = 0
        trouble = ""
        try:
            with Observed(self._file.path) as file:
                found, more = entries(file, state)
        except UserError as error:
            trouble = str(error)
        call_if_open(self, self._found, found, more, trouble)

    def _found(self, found: tuple[Entry, ...], more: int, trouble: str) -> None:
        self._entries = found
        self.set_class(not found, "-empty")
        if not found:
            words = trouble or nothing_yet(
                self._state, self._engine()[0], attach_name(self._file.path)
            )
            self.query_one("#why-empty", Static).update(
                Text("\n".join(map(plain, words.split("\n"))))
            )
            return
        beyond = f" · {more} more are not listed" if more else ""
        numbers = "; other numbers" if found[-1].figures else ""
        self.query_one("#why-models").border_title = Text(f"Without each model{numbers}{beyond}")
        self._list()

    def _list(self) -> None:
        options = self.query_one("#why-list", OptionList)
        if not self._entries:
            return
        width = max(20, options.size.width - options.styles.scrollbar_size_vertical)
        at = options.highlighted or 0
        options.set_options(map(Option, listed(self._entries, width)))
        self.query_one("#why-head", Static).update(head(width))
        options.highlighted = min(at, len(self._entries) - 1)
        self._show_entry()

    @property
    def entry(self) -> Entry | None:
        at = self.query_one("#why-list", OptionList).highlighted
        if at is not None and at < len(self._entries):
            return self._entries[at]
        return None

    @on(OptionList.OptionHighlighted)
    def _show_entry(self) -> None:
        one = self.entry
        if one is None:
            return
        ways, lacks = self._ways(one)
        doubts = (*lacks, *shape_doubts(self._state))
        self.query_one("#why-said", Static).update(said(one, doubts))
        self.query_one("#why-scroll").scroll_home(animate=False)
        self.map.show(one.snapshot, without(one.snapshot.state.environment, one.gone))
        parting = None if one.parting is None else one.parting.place
        apart = (one.letter.lower(), "left out in one") if one.gone else None
        self.map.show_limits(one.limits)
        self.map.show_ways(ways, parting, apart, self._place.prints)
        if one.parting is None or not ways:
            title = "World"
        else:
            title = f"The two paths, seed {one.parting.seed}"
        self.query_one("#why-world").border_title = Text(title)
        self.query_one(MapLines).show(self.map.shown)

    def _ways(self, one: Entry) -> tuple[tuple[Way, ...], Sequence[str]]:
        """The ways of the two runs that are compared, and what the run file lacks of them."""
        if one.parting is None:
            return (), ()
        both = one.parting.with_test, one.parting.without_test
        try:
            found = [played(self._file, self._position, test) for test in both]
        except UserError as error:
            return (), (str(error),)
        lacks = dict.fromkeys(line for each in found for line in each.lacks)
        ways = tuple(
            way_of(each, name) for each, name in zip(found, one.ways, strict=True) if each.rows
        )
        return (ways if len(ways) == 2 else ()), tuple(lacks)

    def action_play(self) -> None:
        one = self.entry
        if one is None or one.parting is None:
            refuse(
                self,
                (
                    "there are no two runs to play: none that share a seed and end differently are "
                    "stored"
                ),
            )
            return
        try:
            both = one.parting.with_test, one.parting.without_test
            self.app.push_screen(
                Playback(self._file, self._position, self._place, *both, one.limits)
            )
        except UserError as error:
            refuse(self, str(error))

    def action_isolate(self) -> None:
        self._ask(
            Stop() if self._engine()[0] and self._position.now.isolating is not None else Isolate()
        )

    def action_margins(self) -> None:
        self.app.push_screen(MarginsDialog(self._position.now, attach_name(self._file.path)))

    def action_copy(self) -> None:
        command = remedy(self._state, self._engine()[0], attach_name(self._file.path))
        lines = [" ".join(filter(None, (one.sentence, *one.more))) for one in self._entries]
        if not lines and not command:
            refuse(self, "there is nothing to copy yet")
            return
        self.app.copy_to_clipboard("\n".join(map(plain, lines or [command])))
        self.notify("copied, if the terminal allows it", timeout=3)


class MarginsDialog(Reading):
    """The margins that `state` has. `run` is what a shell calls the run."""

    BINDINGS: ClassVar = keys(
        "margins", ("close", "escape,m,q,enter", "dismiss", "close", "close this dialog")
    )

    def __init__(self, state: RunState, run: str) -> None:
        known = state.margins
        if known is None or not (found := rows(known)):
            command = f"ddenv margins {plain(run)} finds how far each number can change"
            super().__init__("Margins", [("Not looked for yet", [("", command)])])
            return
        lines = []
        for one in found:
            name, now, until, goal, runs = map(plain, one.cells)
            words = (
                f"now {now}; f until {until};{'' if goal == '-' else f' then {goal};'} {runs} runs"
            )
            lines += [(shortened(name, 24), bar(one.margin, 41)), ("", words)]
        sentences = (nearest_fix(known), sureness(known), BAR_WORDS, *shape_doubts(state))
        means = [("", plain(sentence)) for sentence in sentences]
        title = "How far each number can change before f disappears"
        super().__init__("Margins", [(title, lines), ("What this means", means)])
