"""A dialog that asks a question, answered by yes or no: also whether a program may start that a scenario or a run brings along."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.screen import ModalScreen
from textual.widgets import Button, Static

from ddenv.text import plain
from ddenv.workbench.help.hints import Framed

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario


class Question(ModalScreen[bool]):
    """Returns True for yes. The text may contain names from files, so it is never markup."""

    CSS = """
    Question .dialog { width: 72; }
    Question .dialog Static { width: 100%; }
    """
    BINDINGS: ClassVar = [
        Binding("y", "dismiss(True)", "yes", id="question.yes", tooltip="yes, do it"),
        Binding("n,escape", "dismiss(False)", "no", id="question.no", tooltip="no, leave everything as it is"),
        Binding("left", "app.focus_previous", show=False, id="question.previous", tooltip="previous button"),
        Binding("right", "app.focus_next", show=False, id="question.next", tooltip="next button"),
    ]

    def __init__(self, text: str, *, final: bool = False) -> None:
        """With `final`, enter alone means no."""
        super().__init__()
        self._text, self._final = text, final

    def compose(self) -> ComposeResult:
        with Framed("Sure?", "y yes   n no"):
            yield Static(Text(self._text), markup=False)
            with Horizontal(classes="buttons"):
                yield Button("Yes", id="yes", variant="primary")
                yield Button("No", id="no")

    def on_mount(self) -> None:
        self.query_one("#no" if self._final else "#yes").focus()

    def on_button_pressed(self, event: Button.Pressed) -> None:
        self.dismiss(event.button.id == "yes")


def once_trusted(app: App[Any], scenario: Scenario, where: Path, then: Callable[[bool], None]) -> None:
    """Calls `then` with whether the user trusts what `scenario` (of the file `where`) starts; asks only where that is not known."""
    from ddenv.runs.trust import trust, untrusted

    program = untrusted(scenario)
    if program is None:
        then(True)
        return

    def answered(yes: bool | None) -> None:
        if yes:
            trust(program)
        then(bool(yes))

    app.push_screen(Question(plain(f"{where} starts {program.words}. Do you trust it?"), final=True), answered)
