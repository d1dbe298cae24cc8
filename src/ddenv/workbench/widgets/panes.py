"""The titles of the panes in one line, for terminals with room for only one or two panes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from textual import events
from textual.app import ComposeResult
from textual.containers import HorizontalGroup
from textual.message import Message
from textual.widgets import Static


class Panes(HorizontalGroup):
    """Brackets mark the shown pane, and so do colours if there are any."""

    @dataclass
    class Chosen(Message):
        """A title was clicked."""

        pane: str

    def __init__(self, titles: Mapping[str, str], *, id: str) -> None:
        """`titles` are the texts of each pane by name: its key, and what it shows."""
        super().__init__(id=id)
        self._titles = dict(titles)

    def compose(self) -> ComposeResult:
        for pane, title in self._titles.items():
            yield Static(f" {title} ", id=f"pane-{pane}", classes="pane", markup=False)

    def mark(self, pane: str) -> None:
        for name, title in self._titles.items():
            shown = name == pane
            static = self.query_one(f"#pane-{name}", Static)
            static.update(f"[{title}]" if shown else f" {title} ")
            static.set_class(shown, "-shown")

    def on_click(self, event: events.Click) -> None:
        id = getattr(event.widget, "id", None) or ""
        if id.startswith("pane-"):
            self.post_message(self.Chosen(id.removeprefix("pane-")))
