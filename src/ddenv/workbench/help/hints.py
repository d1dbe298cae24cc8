"""Keys with their words, which a click presses: below the frames of dialogs and panes, and in the
footer.
"""

from __future__ import annotations

from collections.abc import Mapping

from rich.text import Text
from textual.binding import Binding
from textual.containers import Vertical
from textual.content import Content
from textual.style import Style
from textual.widget import Widget

from ddenv.workbench.help.key_names import shown_key

# Textual's names of keys that are written otherwise.
NAMED = {"↑": "up", "↓": "down", "←": "left", "→": "right", "^o": "ctrl+o"}
GAP = "   "
# What a dialog says of a key stands in place of the keys for so long, s.
SAID = 3.0


class Keys(Widget):
    """A widget that shows keys as `pressing` marks them: a click presses a key."""

    def action_press(self, key: str) -> None:
        """Presses a key here: a pane without the focus gets it first."""
        focused = self.screen.focused
        if focused is None or self not in focused.ancestors:
            inside = next(
                (node for node in self.screen.focus_chain if self in node.ancestors), None
            )
            if inside is not None:
                self.screen.set_focus(inside)
        # By the app itself: a key that this widget sends would not come further up than to it.
        self.app.call_later(self.app.simulate_key, key)


def pressing(key: str, action: str = "") -> Style:
    """The style of words that press `key` when they are clicked, or do `action` instead."""
    return Style.from_meta({"@click": action or f"press({key!r})", "key": key})


class Framed(Vertical, Keys):
    """`hints` are keys with what they do, three spaces apart: `enter opens   escape cancels`."""

    def __init__(
        self, title: str | Text, hints: str = "", *, id: str | None = None, classes: str = "dialog"
    ) -> None:
        super().__init__(id=id, classes=classes)
        self.border_title = title
        self._hints = hints

    def on_mount(self) -> None:
        """Shows the hints, with the user's own keys in place of the usual ones."""
        if not self._hints:
            return
        now: dict[str | None, list[str]] = {}
        for active in self.screen.active_bindings.values():
            now.setdefault(active.binding.id, []).append(active.binding.key)
        usual = [each for each in Binding.make_bindings(self.screen.BINDINGS) if each.id in now]
        own = {each.key: now[each.id][0] for each in usual if each.key not in now[each.id]}
        self.border_subtitle = clickable(self._hints, own)

    def say(self, words: str) -> None:
        """Says what a key did, in place of the keys for a moment: a notice would wait until the
        dialog is closed.
        """
        self.border_subtitle = Content(words)
        self.set_timer(SAID, self.on_mount)


def clickable(hints: str, own: Mapping[str, str] = {}) -> Content:
    """Hints to click, each for the key that it begins with; `own` has the user's keys by the usual
    ones.
    """
    parts = []
    for hint in hints.split(GAP):
        word, _, words = hint.partition(" ")
        key = NAMED.get(word, word)
        said = f"{shown_key(own[key])} {words}" if key in own else hint
        parts.append(Content.styled(said, pressing(own.get(key, key))))
    return Content(GAP).join(parts)
