"""Dialogs that ask a question: also whether a program may start that a scenario or a run brings
along.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.containers import Horizontal
from textual.screen import ModalScreen
from textual.widgets import Button, Static

from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario


class Choice(ModalScreen[str]):
    """Returns the answer that was chosen. `answers` are the words of the buttons by answers; the
    first one has the focus.

    `text` may contain names from files, so it is never markup.
    """

    BINDINGS: ClassVar = keys(
        "choice",
        ("previous", "left", "app.focus_previous", "", "previous button"),
        ("next", "right", "app.focus_next", "", "next button"),
    )

    def __init__(self, title: str, hints: str, text: str, **answers: str) -> None:
        super().__init__()
        self._title = title
        self._hints = hints
        self._text = text
        self._answers = answers

    def compose(self) -> ComposeResult:
        with Framed(self._title, self._hints):
            yield Static(Text(self._text), markup=False)
            with Horizontal(classes="buttons"):
                for number, (answer, words) in enumerate(self._answers.items()):
                    yield Button(words, id=answer, variant="default" if number else "primary")

    def on_button_pressed(self, event: Button.Pressed) -> None:
        self.dismiss(event.button.id or "")

    def action_answer(self, answer: str) -> None:
        self.dismiss(answer)


class Question(Choice):
    """Returns "yes" or "no". With `final`, enter alone means no."""

    BINDINGS: ClassVar = keys(
        "question",
        ("yes", "y", "answer('yes')", "yes", "yes, do it"),
        ("no", "n,escape", "answer('no')", "no", "no, leave everything as it is"),
    )

    def __init__(self, text: str, *, final: bool = False) -> None:
        super().__init__("Sure?", "y yes   n no", text, yes="Yes", no="No")
        self._final = final

    def on_mount(self) -> None:
        self.query_one("#no" if self._final else "#yes").focus()


def ask(app: App[Any], text: str, then: Callable[[], object]) -> None:
    """Calls `then` after a yes."""

    def answered(answer: str | None) -> None:
        if answer == "yes":
            then()

    app.push_screen(Question(text), answered)


def once_trusted(
    app: App[Any], scenario: Scenario, where: Path, then: Callable[[bool], None]
) -> None:
    """Calls `then` with whether the user trusts what `scenario` (of the file `where`) starts; asks
    only where that is not known.
    """
    from ddenv.runs.trust import trust, untrusted

    program = untrusted(scenario)
    if program is None:
        then(True)
        return

    def answered(answer: str | None) -> None:
        if answer == "yes":
            trust(program)
        then(answer == "yes")

    app.push_screen(
        Question(plain(f"{where} starts {program.words}. Do you trust it?"), final=True), answered
    )
