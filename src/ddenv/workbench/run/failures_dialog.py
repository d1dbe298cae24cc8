"""The failures other than f that the tests met; one of them can be reduced in a branch."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.screen import ModalScreen
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from ddenv.guiding.commands import question, refusal
from ddenv.guiding.selections import AcceptOther
from ddenv.guiding.situation import Situation
from ddenv.runfile.events import named
from ddenv.runfile.failures import OtherFailure, atlas
from ddenv.runfile.state import RunState
from ddenv.text import count, first_of, plain, shortened
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys
from ddenv.workbench.widgets.question import ask

# Time between two looks at the run, s.
PERIOD = 0.5
# The maximum number of failures in the list, and of models by name.
LISTED, NAMED = 200, 8
# The width of the columns.
FAILURE, TESTS = 36, 7


class FailuresMet(ModalScreen[int | None]):
    """Returns the test whose failure is to be reduced, or None. It follows the run while it is open."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        *keys("failures", ("go", "enter", "go", "reduce it", "reduce this failure in a branch"), priority=True),
        *keys("failures", ("close", "escape,f,q", "dismiss", "close", "back to the run")),
    ]

    def __init__(self, look: Callable[[], Situation]) -> None:
        super().__init__()
        self._look_at = look
        self._found: tuple[OtherFailure, ...] = ()
        self._made_of: tuple[object, ...] = ()

    def compose(self) -> ComposeResult:
        with Framed("Other failures met", "enter reduces it in a branch   escape closes"):
            yield Static(_line("failure", "tests", "smallest environment"), id="head", markup=False)
            yield OptionList(id="failures", compact=True, markup=False)
            yield Static("", id="failure", markup=False)

    def on_mount(self) -> None:
        self.query_one(OptionList).focus()
        self._look()
        self.set_interval(PERIOD, self._look)

    # What is shown.

    def _look(self) -> None:
        state = self._look_at().state
        made_of = state.tally["other"], state.failures
        if made_of == self._made_of:
            return
        at, self._made_of = self._under_cursor, made_of
        self._found = atlas(state)[:LISTED]
        options = self.query_one(OptionList)
        options.set_options(Option(_line(one.name, str(len(one.tests)), _smallest(one))) for one in self._found)
        if self._found:
            stays = (row for row, one in enumerate(self._found) if at is not None and at.tests[0] in one.tests)
            options.highlighted = next(stays, 0)
        self._show_about()

    @property
    def _under_cursor(self) -> OtherFailure | None:
        row = self.query_one(OptionList).highlighted
        return self._found[row] if row is not None and row < len(self._found) else None

    @on(OptionList.OptionHighlighted)
    def _show_about(self) -> None:
        state, one = self._look_at().state, self._under_cursor
        words = Text(_f(state, one), "dim")
        if one is None:
            words = Text("No test shows a failure other than f.\n").append_text(words)
        else:
            names = [plain(shortened(name, 40)) for name in state.models_of(state.tests[one.smallest - 1])]
            words = Text(f"{_smallest(one)}: {first_of(names, NAMED) or 'no models'}\n").append_text(words)
        self.query_one("#failure", Static).update(words)

    # What is done.

    @on(OptionList.OptionSelected)
    def action_go(self) -> None:
        one = self._under_cursor
        if one is None:
            return
        now, command = self._look_at(), AcceptOther(one.smallest, instead=True)
        if why := refusal(command, now):
            self.query_one("#failure", Static).update(Text(f"✗ {plain(why)}", "bold"))
            return
        ask(self.app, question(command, now.state), lambda: self.dismiss(one.smallest))


def _line(failure: str, tests: str, smallest: str) -> Text:
    return Text(f"{failure:<{FAILURE}}{tests:>{TESTS}}   {smallest}", no_wrap=True)


def _smallest(one: OtherFailure) -> str:
    return f"{count(one.size, 'model')} (test {one.smallest})"


def _f(state: RunState, one: OtherFailure | None) -> str:
    if state.f_position is None:
        return "f is not known yet."
    # Ends that differ in height alone have similar names.
    away = "" if one is None else f", {math.dist(one.position, state.f_position):.2f} m from this end"
    return f"f: {named((state.failure,), state.f_position)}{away}"
