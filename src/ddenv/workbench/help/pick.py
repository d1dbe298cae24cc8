"""A dialog that lists lines to choose one from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.screen import ModalScreen
from textual.widgets import OptionList, Static

from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys


class Pick(ModalScreen[int | None]):
    """Returns the number of the line that was chosen, or None. The line `head` stands above, the cursor begins `at` a line."""

    BINDINGS: ClassVar = keys("pick", ("close", "escape,q", "dismiss", "close", "choose nothing"))

    def __init__(self, title: str, does: str, lines: Sequence[Text], *, head: Text | None = None, at: int = 0) -> None:
        super().__init__()
        self._title, self._does, self._lines, self._head, self._at = title, does, lines, head, at

    def compose(self) -> ComposeResult:
        with Framed(self._title, f"enter {self._does}   escape closes"):
            if self._head is not None:
                yield Static(self._head, id="head", markup=False)
            yield OptionList(*self._lines, id="lines", compact=True, markup=False)

    def on_mount(self) -> None:
        options = self.query_one(OptionList)
        options.focus()
        options.highlighted = self._at

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        self.dismiss(event.option_index)
