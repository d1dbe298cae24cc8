"""The names of the panes in one line, for terminals that show only one or two of them at a time."""

from __future__ import annotations

from collections.abc import Mapping

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.containers import HorizontalGroup
from textual.message import Message
from textual.widgets import Static

# Name and words, in the order of the keys 1 to 5.
PANES = (("map", "map"), ("round", "round"), ("chart", "chart"), ("now", "what is happening"), ("log", "log"))


class Panes(HorizontalGroup):
    """The one that is shown is marked by its brackets, and by its colours where there are any."""

    class Chosen(Message):
        """A name was clicked."""

        def __init__(self, pane: str) -> None:
            super().__init__()
            self.pane = pane

    def compose(self) -> ComposeResult:
        for pane, _ in PANES:
            yield Static("", id=f"pane-{pane}", classes="pane", markup=False)

    def on_mount(self) -> None:
        self.mark(PANES[0][0])

    def mark(self, pane: str) -> None:
        """`pane` is shown from now on."""
        for number, (name, words) in enumerate(PANES, start=1):
            static = self.query_one(f"#pane-{name}", Static)
            shown = name == pane
            static.update(f"[{number} {words}]" if shown else f" {number} {words} ")
            static.set_class(shown, "-shown")

    def on_click(self, event: events.Click) -> None:
        id = getattr(event.widget, "id", None) or ""
        if id.startswith("pane-"):
            self.post_message(self.Chosen(id.removeprefix("pane-")))


class SetupPanes(HorizontalGroup):
    """The titles in a row, each with its key; the one that is shown is marked by its brackets."""

    class Asked(Message):
        """The user wants to see this pane."""

        def __init__(self, pane: str) -> None:
            super().__init__()
            self.pane = pane

    def __init__(self, panes: Mapping[str, str], *, id: str) -> None:
        """`panes` has the panes by the keys that show them."""
        super().__init__(id=id)
        self._panes = dict(panes)

    def compose(self) -> ComposeResult:
        for pane in self._panes.values():
            yield Static("", id=f"to-{pane}", classes="pane-title", markup=False)

    def mark(self, pane: str) -> None:
        """`pane` is shown from now on."""
        for key, name in self._panes.items():
            shown = name == pane
            words = Text(f"[{key} {name}]", "bold") if shown else Text(f" {key} {name} ", "not bold")
            title = self.query_one(f"#to-{name}", Static)
            title.update(words)
            title.set_class(shown, "-shown")

    def on_click(self, event: events.Click) -> None:
        id = getattr(event.widget, "id", None) or ""
        if id.startswith("to-"):
            self.post_message(self.Asked(id.removeprefix("to-")))
