"""Two things side by side: a line for each fact, bold where they differ."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys


class SideBySide(ModalScreen[None]):
    """`lines` have the name of a fact, and what it is in the first and in the second one."""

    BINDINGS: ClassVar = keys("compare", ("close", "escape,c,q,enter", "dismiss", "close", "close this dialog"))

    def __init__(self, title: str, lines: Iterable[tuple[str, str, str]]) -> None:
        super().__init__()
        self._title, self._lines = title, lines

    def compose(self) -> ComposeResult:
        table = Table.grid(padding=(0, 2), expand=True)
        table.add_column(style="dim", max_width=28, overflow="fold")
        table.add_column(ratio=1, overflow="fold")
        table.add_column(ratio=1, overflow="fold")
        for name, one, other in self._lines:
            style = "" if one == other else "bold"
            # Not by weight alone: some terminals and all screen readers drop it.
            table.add_row(name if one == other else f"{name} ≠", Text(one, style), Text(other, style))
        with Framed(self._title, "↑ ↓ scroll   escape closes"), VerticalScroll():
            yield Static(table, markup=False)
