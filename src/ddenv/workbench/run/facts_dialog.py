"""The dialog with the raw facts of a test: its log, its contacts, its end, its seed, and the command that makes it again."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.run.facts import Facts, facts

WIDTH = 11


class FactsDialog(ModalScreen[None]):
    """Starts at a test; the arrows go to the tests before and after it."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("left", "step(-1)", "test before", id="facts.before", tooltip="the test before this one"),
        Binding("right", "step(1)", "next test", id="facts.next", tooltip="the next test"),
        Binding("p,P", "play", "play", id="facts.play", tooltip="play this test back on the map"),
        Binding("c", "copy", "copy", id="facts.copy", tooltip="copy the command that makes it again (OSC 52)"),
        Binding("escape,i,q,enter", "dismiss", "close", id="facts.close", tooltip="back to the run"),
    ]

    def __init__(self, position: Position, test: int, run: str, play: Callable[[int], str]) -> None:
        """`run` is what a shell calls the run. `play` plays a test back, or returns why it cannot."""
        super().__init__()
        self._position, self._test, self._run, self._play = position, test, run, play
        self._facts: Facts | None = None

    def compose(self) -> ComposeResult:
        hints = "← → other tests   p plays it   c copies the command   escape closes"
        with Framed("", hints, classes="dialog reading"), VerticalScroll():
            yield Static("", id="facts", markup=False)

    def on_mount(self) -> None:
        self._show(self._test)

    def _show(self, test: int) -> None:
        try:
            found = facts(self._position, test, self._run)
        except UserError as error:
            self.query_one(Framed).say(plain(str(error)))
            return
        if found is not None:
            self._test, self._facts = test, found
            self.query_one(".dialog").border_title = Text(found.title)
            self.query_one("#facts", Static).update(_text(found))
            self.query_one(VerticalScroll).scroll_home(animate=False)

    def action_step(self, by: int) -> None:
        self._show(self._test + by)

    def action_play(self) -> None:
        if why := self._play(self._test):
            self.query_one(Framed).say(plain(why))

    def action_copy(self) -> None:
        if self._facts is not None:
            self.app.copy_to_clipboard(self._facts.command)
            self.query_one(Framed).say("command copied, if the terminal allows it")


def _text(found: Facts) -> Text:
    text = Text()
    for name, words in found.facts:
        text.append(f"{name:<{WIDTH}}", "dim").append(f"{words}\n")
    text.append("\nlog\n", "bold")
    for at, words in found.log:
        text.append(f"{at:>8.1f} s  ", "dim").append(f"{words}\n")
    return text.append("\nto make it again\n", "bold").append(f"  {found.command}")
