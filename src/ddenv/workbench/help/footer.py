"""The footer: the most important keys that fit. Textual's own shows the first ones, and scrolls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.cells import cell_len
from textual.content import Content
from textual.screen import Screen

from ddenv.workbench.help.hints import Keys, pressing

LAST = (".help", ".quit", ".close", ".back")


@dataclass(frozen=True, slots=True)
class Entry:
    """A key as it is shown, and what it does."""

    key: str
    shown: str
    words: str
    enabled: bool


class KeyFooter(Keys):
    """Shows bindings by their ids, those `first` that matter most if not all fit.

    Where `instead` returns ids, these are shown in their place: a pane with the focus has keys of
    its own.
    """

    ALLOW_SELECT = False
    auto_links = False

    def __init__(self, first: Sequence[str], instead: Callable[[], Sequence[str]] = tuple) -> None:
        super().__init__()
        self._first = first
        self._instead = instead
        self._words: dict[str, tuple[str, str]] = {}
        self.entries: tuple[Entry, ...] = ()
        self._due = False

    def say(self, id: str, words: str, shown: str = "") -> None:
        """Other words for a key, and maybe another way to write it; with "" it is not shown."""
        if self._words.get(id) != (words, shown):
            self._words[id] = words, shown
            self._renew_soon()

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._bindings_changed)

    def _bindings_changed(self, screen: Screen[Any]) -> None:
        if screen.app.app_focus and screen is self.screen:
            self._renew_soon()

    def _renew_soon(self) -> None:
        # To list what all keys do takes a while: one key changes several words, and the focus sends
        # several signals.
        if not self._due:
            self._due = True
            self.call_later(self.renew)

    def on_resize(self) -> None:
        self.renew()

    def renew(self) -> None:
        self._due = False
        if not self.is_attached:
            return
        active = {each.binding.id: each for each in self.screen.active_bindings.values()}
        room = self.screen.size.width
        found: dict[str, Entry] = {}
        for id in self._instead() or self._first:
            if id not in active:
                continue
            binding = active[id].binding
            words, shown = self._words.get(id, (binding.description, ""))
            shown = shown or self.app.get_key_display(binding)
            width = cell_len(shown) + cell_len(words) + 2
            if words and width <= room:
                found[id] = Entry(binding.key, shown, words, active[id].enabled)
                room -= width
        # Help and the way out stand last.
        entries = tuple(found[id] for id in sorted(found, key=lambda id: id.endswith(LAST)))
        if entries != self.entries:
            self.entries = entries
            self.refresh()

    def render(self) -> Content:
        parts: list[Content | str] = []
        for entry in self.entries:
            drawn = Content.assemble(
                (entry.shown, "bold $footer-key-foreground"), f" {entry.words}"
            )
            drawn = drawn if entry.enabled else drawn.stylize("dim")
            parts += [drawn.stylize(pressing(entry.key, "" if entry.enabled else "app.bell")), " "]
        return Content.assemble(*parts)
