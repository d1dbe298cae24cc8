"""What can be taken along: copied to the clipboard of the terminal's own machine (OSC 52)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from ddenv.workbench.wording import plain, shorten


class Copy(ModalScreen[None]):
    """A list of texts, of which enter or a click copies one."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("escape,y,q", "dismiss", "close", id="copy.close", tooltip="copy nothing"),
    ]

    def __init__(self, texts: Sequence[tuple[str, str]]) -> None:
        """`texts` are (what it is, the text itself)."""
        super().__init__()
        self._texts = tuple(texts)

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = "Copy"
            dialog.border_subtitle = "enter or click copies   escape closes"
            yield OptionList(*(Option(_prompt(*each)) for each in self._texts), compact=True, markup=False)

    @on(OptionList.OptionSelected)
    def _chosen(self, event: OptionList.OptionSelected) -> None:
        what, text = self._texts[event.option_index]
        self.app.copy_to_clipboard(text)
        self.notify(f"{what} copied, if the terminal allows it", timeout=3, markup=False)
        self.dismiss(None)


def _prompt(what: str, text: str) -> Text:
    lines = text.splitlines()
    more = f" and {len(lines) - 1} more lines" if len(lines) > 1 else ""
    shown = shorten(plain(lines[0]), 40) if lines else ""
    return Text(f"{what:<24} ", no_wrap=True).append(f"{shown}{more}", "dim")
