"""The footer: the most important keys that fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from rich.cells import cell_len
from rich.text import Text
from textual import events
from textual.screen import Screen
from textual.widget import Widget

from ddenv.workbench.help.shortcuts import offered


@dataclass(frozen=True, slots=True)
class Entry:
    """A key as it is shown, and what it does."""

    key: str
    shown: str
    words: str
    enabled: bool
    tooltip: str

    @property
    def width(self) -> int:
        return cell_len(self.shown) + cell_len(self.words) + 2


class KeyFooter(Widget):
    """Shows bindings by id. `shown` is their order on the screen, `first` their priority if not all fit.

    Where `instead` returns ids, these are shown in their place, in this order: a pane with the focus has keys of its own.

    A click on a key presses it. It is one widget, since the focus moves often and the keys change with it.
    """

    ALLOW_SELECT = False
    COMPONENT_CLASSES: ClassVar = {"key-footer--key", "key-footer--words", "key-footer--hover"}
    DEFAULT_CSS = """
    KeyFooter {
        dock: bottom;
        height: 1;
        color: $footer-foreground;
        background: $footer-background;
        & > .key-footer--key { color: $footer-key-foreground; text-style: bold; }
        & > .key-footer--words { color: $footer-description-foreground; }
        & > .key-footer--hover { background: $block-hover-background; }
    }
    """

    def __init__(
        self, shown: Sequence[str], first: Sequence[str], instead: Callable[[], Sequence[str]] = tuple
    ) -> None:
        super().__init__()
        self._instead = instead
        self._order, self._first = tuple(shown), tuple(first)
        self._words: dict[str, str] = {}
        self.entries: tuple[Entry, ...] = ()
        self._hovered: Entry | None = None
        self._due = False

    def say(self, id: str, words: str) -> None:
        """Other words for a key; with "" it is not shown."""
        if self._words.get(id) != words:
            self._words[id] = words
            self._renew()

    def renew(self) -> None:
        """Shows the keys that `instead` returns now."""
        self._renew()

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._bindings_changed)

    def _bindings_changed(self, screen: Screen[Any]) -> None:
        # One move of the focus sends several of these signals.
        if screen.app.app_focus and screen is self.screen and not self._due:
            self._due = True
            self.call_after_refresh(self._renew)

    def on_resize(self) -> None:
        self._renew()

    def _renew(self) -> None:
        self._due = False
        if self.is_attached and (entries := self._fitting()) != self.entries:
            self.entries = entries
            self.refresh()

    def _fitting(self) -> tuple[Entry, ...]:
        """The keys that fit."""
        active = {each.binding.id: each for each in offered(self.screen)}
        room = self.screen.size.width
        found: dict[str, Entry] = {}
        instead = self._instead()
        for id in instead or self._first:
            if id not in active:
                continue
            binding = active[id].binding
            words = self._words.get(id, binding.description)
            entry = Entry(binding.key, self.app.get_key_display(binding), words, active[id].enabled, active[id].tooltip)
            if words and entry.width <= room:
                found[id] = entry
                room -= entry.width
        return tuple(found[id] for id in instead or self._order if id in found)

    def render(self) -> Text:
        key, words = (self.get_component_rich_style(f"key-footer--{part}", partial=True) for part in ("key", "words"))
        text = Text(no_wrap=True, end="")
        for entry in self.entries:
            begin = len(text)
            text.append(entry.shown, key).append(f" {entry.words}", words)
            if not entry.enabled:
                text.stylize("dim", begin)
            if entry is self._hovered:
                text.stylize(self.get_component_rich_style("key-footer--hover", partial=True), begin)
            text.append(" ")
        return text

    # The mouse.

    def _at(self, x: int) -> Entry | None:
        for entry in self.entries:
            if x < entry.width:
                return entry if x < entry.width - 1 else None
            x -= entry.width
        return None

    def on_mouse_move(self, event: events.MouseMove) -> None:
        self._hover(self._at(event.x))

    def on_leave(self) -> None:
        self._hover(None)

    def _hover(self, entry: Entry | None) -> None:
        if entry is not self._hovered:
            self._hovered = entry
            self.tooltip = entry.tooltip if entry else None
            self.refresh()

    def on_click(self, event: events.Click) -> None:
        entry = self._at(event.x)
        if entry is None:
            return
        if entry.enabled:
            self.app.simulate_key(entry.key)
        else:
            self.app.bell()
