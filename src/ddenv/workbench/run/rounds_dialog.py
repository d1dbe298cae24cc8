"""The rounds of a run so far, the baseline before them and the certificates after them: the user goes to any of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from ddenv.runfile.position import Chapter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.wording import count

NAME, MODELS, LEFT, TESTS = 16, 8, 10, 14


class Rounds(ModalScreen[Chapter | None]):
    """Returns the chapter to go to, or None."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("escape,b,q", "dismiss", "close", id="rounds.close", tooltip="back to the run"),
    ]

    def __init__(self, chapters: Sequence[Chapter], at: int | None) -> None:
        """The cursor starts on the chapter with the event `at`, or on the last one."""
        super().__init__()
        self._chapters = chapters
        self._start = next((row for row, each in enumerate(chapters) if at and at <= each.last), len(chapters) - 1)

    def compose(self) -> ComposeResult:
        with Framed("Rounds so far", "enter goes to its end   escape closes"):
            yield Static(_line("", "models", "left", "after"), id="head", markup=False)
            yield OptionList(*map(_option, self._chapters), id="rounds", compact=True, markup=False)

    def on_mount(self) -> None:
        options = self.query_one(OptionList)
        options.focus()
        options.highlighted = self._start

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        self.dismiss(self._chapters[event.option_index])


def _option(chapter: Chapter) -> Option:
    less = chapter.left != chapter.models
    left = f"{'●' if less else '○'} {chapter.left}" if chapter.kind == "round" else ""
    return Option(_line(title(chapter), str(chapter.models), left, count(chapter.tests, "test")))


def title(chapter: Chapter) -> str:
    """What a chapter is."""
    return "baseline" if chapter.kind == "baseline" else f"{chapter.kind} {chapter.number}"


def _line(name: str, models: str, left: str, tests: str) -> Text:
    return Text(f"{name:<{NAME}}{models:>{MODELS}}{left:>{LEFT}}{tests:>{TESTS}}", no_wrap=True)
