"""Dialogs of every screen: a text to read, lines to choose one from, and two things side by
side.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import OptionList, Static

from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys


class Reading(ModalScreen[None]):
    """A dialog with rows under titles: what stands there, in bold, and what it means."""

    def __init__(
        self, title: str, groups: Iterable[tuple[str, Iterable[tuple[str | Text, str | Text]]]]
    ) -> None:
        super().__init__()
        self._title = title
        self._groups = groups

    def compose(self) -> ComposeResult:
        table = Table.grid(padding=(0, 2))
        table.add_column(justify="right", style="bold", min_width=4, max_width=24)
        table.add_column(overflow="fold")
        for title, rows in self._groups:
            if table.row_count:
                table.add_row()
            table.add_row("", Text(title, "bold underline"))
            for row in rows:
                table.add_row(*row)
        with (
            Framed(self._title, "↑ ↓ scroll   escape closes", classes="dialog reading"),
            VerticalScroll(),
        ):
            yield Static(table, markup=False)


class Pick(ModalScreen[int | None]):
    """Returns the number of the line that was chosen, or None. The line `head` stands above, the
    cursor begins `at` a line.
    """

    BINDINGS: ClassVar = keys("pick", ("close", "escape,q", "dismiss", "close", "choose nothing"))

    def __init__(
        self, title: str, does: str, lines: Sequence[Text], *, head: Text | None = None, at: int = 0
    ) -> None:
        super().__init__()
        self._title = title
        self._does = does
        self._lines = lines
        self._head = head
        self._at = at

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


class SideBySide(ModalScreen[None]):
    """`lines` have the name of a fact, and what it is in the first and in the second one."""

    BINDINGS: ClassVar = keys(
        "compare", ("close", "escape,c,q,enter", "dismiss", "close", "close this dialog")
    )

    def __init__(self, title: str, lines: Iterable[tuple[str, str, str]]) -> None:
        super().__init__()
        self._title = title
        self._lines = lines

    def compose(self) -> ComposeResult:
        table = Table.grid(padding=(0, 2), expand=True)
        table.add_column(style="dim", max_width=28, overflow="fold")
        table.add_column(ratio=1, overflow="fold")
        table.add_column(ratio=1, overflow="fold")
        for name, one, other in self._lines:
            style = "" if one == other else "bold"
            # Not by weight alone: some terminals and all screen readers drop it.
            table.add_row(
                name if one == other else f"{name} ≠", Text(one, style), Text(other, style)
            )
        with Framed(self._title, "↑ ↓ scroll   escape closes"), VerticalScroll():
            yield Static(table, markup=False)
