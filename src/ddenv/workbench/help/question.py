"""A question above a screen that is answered by yes or no."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.screen import ModalScreen
from textual.widgets import Button, Static


class Question(ModalScreen[bool]):
    """True for yes. The text may hold names from files: it is never markup."""

    CSS_PATH: ClassVar = ["dialogs.tcss", "guide.tcss"]
    BINDINGS: ClassVar = [
        Binding("y", "answer(True)", "yes", id="question.yes", tooltip="yes, do it"),
        Binding("n,escape", "answer(False)", "no", id="question.no", tooltip="no, leave everything as it is"),
        Binding("left", "app.focus_previous", show=False, id="question.previous", tooltip="previous button"),
        Binding("right", "app.focus_next", show=False, id="question.next", tooltip="next button"),
    ]

    def __init__(self, text: str, *, final: bool = False) -> None:
        """Where yes is `final`, enter alone means no."""
        super().__init__()
        self._text, self._final = text, final

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = "Sure?"
            dialog.border_subtitle = "y yes   n no"
            yield Static(Text(self._text), markup=False)
            with Horizontal(classes="buttons"):
                yield Button("Yes", id="yes", variant="primary")
                yield Button("No", id="no")

    def on_mount(self) -> None:
        self.query_one("#no" if self._final else "#yes").focus()

    def on_button_pressed(self, event: Button.Pressed) -> None:
        self.dismiss(event.button.id == "yes")

    def action_answer(self, answer: bool) -> None:
        self.dismiss(answer)
