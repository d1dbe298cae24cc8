"""A choice among the partitionings, prioritizations or algorithms, and the place where what is looked at is explained."""

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
    """What the field means that has the focus, in a few lines that scroll."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, can_focus=False)
        self.title = ""

    def compose(self) -> ComposeResult:
        yield Static("", markup=False)

    def show(self, title: str, words: str, warning: str = "") -> None:
        """`title` is the name of what is explained, `warning` a sentence that comes first and stands out."""
        self.title = title
        text = Text(title, "bold").append("  ")
        if warning:
            text.append(warning, f"bold {self.app.theme_variables['text-warning']}").append(" ")
        self.query_one(Static).update(text.append(words, "not bold"))
        self.scroll_home(animate=False)
