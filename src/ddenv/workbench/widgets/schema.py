"""A choice among the partitionings, prioritizations or algorithms, and the place where the one looked at is explained."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.message import Message
from textual.widgets import OptionList, Select, Static

from ddenv.schemas import Kind, names
from ddenv.workbench.methods import note, paragraph
from ddenv.workbench.wording import plain


class SchemaSelect(Select[str]):
    """All names of a kind; its id is the kind."""

    # Here, not on the screen: the form around it would take these keys for itself.
    BINDINGS: ClassVar = [
        Binding("pagedown", "screen.scroll(1)", "more", id="schema.more", tooltip="scroll an explanation", show=False),
        Binding("pageup", "screen.scroll(-1)", "back", id="schema.back", tooltip="scroll it back", show=False),
    ]

    class Looked(Message):
        """The user looks at this name: the chosen one, or in the open list the highlighted one."""

        def __init__(self, kind: Kind, name: str) -> None:
            super().__init__()
            self.kind, self.name = kind, name

    def __init__(self, kind: Kind, tooltip: str) -> None:
        super().__init__([(name, name) for name in names(kind)], id=kind, allow_blank=False, compact=True)
        self.kind: Kind = kind
        self.tooltip = tooltip

    @property
    def chosen(self) -> str:
        return str(self.value)

    def on_mount(self) -> None:
        self.watch(self.query_one(OptionList), "highlighted", self._highlighted, init=False)

    def on_focus(self) -> None:
        self.post_message(self.Looked(self.kind, self.chosen))

    def _highlighted(self, index: int | None) -> None:
        if self.expanded and index is not None:
            self.post_message(self.Looked(self.kind, names(self.kind)[index]))

    @on(Select.Changed)
    def _changed(self) -> None:
        self.post_message(self.Looked(self.kind, self.chosen))


class Explained(VerticalScroll):
    """The explanation of one name, under its kind and name."""

    def compose(self) -> ComposeResult:
        yield Static("", markup=False)

    def show(self, kind: Kind, name: str, algorithm: str, here: str = "") -> None:
        """`algorithm` is the chosen one, which may not use this kind; `here` is a sentence on the scenario's own settings."""
        self.border_title = Text(f"{kind} {plain(name)}")
        words = Text()
        unused = note(kind, name if kind == "algorithm" else algorithm)
        if unused:
            words.append(unused, f"bold {self.app.theme_variables['text-warning']}").append(" ")
        words.append(paragraph(kind, name))
        self.query_one(Static).update(words.append(f" {here}" if here else ""))
