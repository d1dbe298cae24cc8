"""The footer: the keys that are needed most, as many as there is room for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from textual.app import ComposeResult
from textual.screen import Screen
from textual.widgets import Footer
from textual.widgets._footer import FooterKey


@dataclass(frozen=True, slots=True)
class _Entry:
    """A key as it is shown, and what it does."""

    key: str
    shown: str
    words: str
    action: str
    enabled: bool
    tooltip: str

    @property
    def width(self) -> int:
        return len(self.shown) + len(self.words) + 2


class KeyFooter(Footer):
    """Shows bindings by id. `shown` is their order on the screen, `first` the order in which they are given room."""

    def __init__(self, shown: Sequence[str], first: Sequence[str]) -> None:
        super().__init__(compact=True, show_command_palette=False)
        self._order, self._first = tuple(shown), tuple(first)
        self._words: dict[str, str] = {}
        self._made: tuple[_Entry, ...] = ()

    def say(self, id: str, words: str) -> None:
        """Other words for a key; without any it is not shown."""
        if self._words.get(id) != words:
            self._words[id] = words
            self._renew()

    def bindings_changed(self, screen: Screen) -> None:
        # The focus moves often, and most keys stay what they are.
        if screen.app.app_focus and screen is self.screen:
            self._renew()

    def on_resize(self) -> None:
        self._renew()

    def _renew(self) -> None:
        if self.is_attached and self._entries() != self._made:
            self.refresh(recompose=True)

    def _entries(self) -> tuple[_Entry, ...]:
        """The keys that fit."""
        active = {each.binding.id: each for each in self.screen.active_bindings.values()}
        room, found = self.screen.size.width, {}
        for id in self._first:
            if id not in active:
                continue
            binding = active[id].binding
            display, words = self.app.get_key_display(binding), self._words.get(id, binding.description)
            entry = _Entry(binding.key, display, words, binding.action, active[id].enabled, active[id].tooltip)
            if words and entry.width <= room:
                found[id] = entry
                room -= entry.width
        return tuple(found[id] for id in self._order if id in found)

    def compose(self) -> ComposeResult:
        self._made = self._entries()
        for each in self._made:
            yield FooterKey(each.key, each.shown, each.words, each.action, not each.enabled, each.tooltip)
