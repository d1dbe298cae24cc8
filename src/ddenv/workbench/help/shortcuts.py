"""What the keys do on a screen now, with the user's own keys: for the footer, the help and the list
of commands.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from rich.text import Text
from textual.app import App
from textual.binding import ActiveBinding
from textual.dom import DOMNode
from textual.screen import Screen

from ddenv.text import plain
from ddenv.workbench.help.dialogs import Reading
from ddenv.workbench.help.key_names import shown
from ddenv.workbench.shared.bindings import keys

_FOCUS = "to the next or previous pane, field or button"
_LINE = "one line up or down"
_PAGE = "one page up or down"
_END = "to the first or the last line"
_TAKE = "choose the line under the cursor"
# Textual's own actions that are worth a line in the help.
TEXTUAL_WORDS = {
    "app.focus_next": _FOCUS,
    "app.focus_previous": _FOCUS,
    "screen.copy_text": "copy the text selected with the mouse",
    "cursor_up": _LINE,
    "cursor_down": _LINE,
    "page_up": _PAGE,
    "page_down": _PAGE,
    "first": _END,
    "last": _END,
    "scroll_top": _END,
    "scroll_bottom": _END,
    "select": _TAKE,
    "select_cursor": _TAKE,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shortcut:
    """`keys` as people write them; `action` runs on `node`. It is shown dimmed while it is not
    `enabled`.
    """

    keys: str
    words: str
    action: str
    node: DOMNode
    id: str
    enabled: bool = True


@dataclass(frozen=True, slots=True)
class Group:
    """The shortcuts of a pane, of the screen, or of the app. `hints` are lines below them."""

    title: str
    shortcuts: tuple[Shortcut, ...]
    hints: tuple[str, ...] = ()


def groups(screen: Screen[Any]) -> list[Group]:
    """The focused pane's shortcuts first, then the screen's, then the app's.

    An action whose `check_action` returns False is left out; one with None is shown, but not
    enabled.
    """
    panes: list[ActiveBinding] = []
    own: list[ActiveBinding] = []
    everywhere: list[ActiveBinding] = []
    for active in filter(_words, screen.active_bindings.values()):
        of_app = isinstance(active.node, App) or (active.node is screen and not active.binding.id)
        if of_app:
            everywhere.append(active)
        elif active.node is screen:
            own.append(active)
        else:
            panes.append(active)
    pane = screen.focused
    title = "Here"
    hints = ""
    if pane is not None:
        titles = (
            str(each)
            for node in pane.ancestors_with_self
            if (each := getattr(node, "border_title", None))
        )
        title = plain(next(titles, title))
        hints = (pane.HELP or "") if "HELP" in vars(type(pane)) else ""
    found = [
        Group(
            title, _merged(panes), tuple(plain(line) for line in hints.splitlines() if line.strip())
        ),
        Group("This screen", _merged(own)),
        Group("Everywhere", _merged(everywhere)),
    ]
    return [group for group in found if group.shortcuts or group.hints]


def commands(screen: Screen[Any]) -> list[Shortcut]:
    return [
        each for group in groups(screen) for each in group.shortcuts if each.id and each.enabled
    ]


def _merged(found: Iterable[ActiveBinding]) -> tuple[Shortcut, ...]:
    """A shortcut for each action, with all its keys."""
    same: dict[str, list[ActiveBinding]] = {}
    for active in found:
        same.setdefault(active.binding.id or _words(active), []).append(active)
    shortcuts = []
    for active, *more in same.values():
        binding = active.binding
        keys = shown(",".join(each.binding.key for each in (active, *more)))
        id = binding.id or ""
        shortcuts.append(
            Shortcut(
                keys=keys,
                words=_words(active),
                action=binding.action,
                node=active.node,
                id=id,
                enabled=active.enabled,
            )
        )
    return tuple(shortcuts)


def _words(active: ActiveBinding) -> str:
    binding = active.binding
    if not binding.id:
        return TEXTUAL_WORDS.get(binding.action, "")
    return plain(active.tooltip or binding.tooltip or binding.description)


class Help(Reading):
    """Every key with what it does: those of the focused pane first."""

    BINDINGS: ClassVar = keys(
        "help",
        ("close", "escape,question_mark,q,enter,f1", "dismiss", "close", "close this dialog"),
    )

    def __init__(self, groups: Iterable[Group]) -> None:
        self.groups = tuple(groups)
        known = (shortcut for each in self.groups for shortcut in each.shortcuts)
        palette = next((shortcut.keys for shortcut in known if shortcut.id == "app.commands"), "")
        title = f"Keys · {palette} finds any command by its name" if palette else "Keys"
        super().__init__(title, [(each.title, self._rows(each)) for each in self.groups])

    @staticmethod
    def _rows(group: Group) -> Iterator[tuple[str | Text, str | Text]]:
        for shortcut in group.shortcuts:
            style = "" if shortcut.enabled else "dim"
            yield Text(shortcut.keys, style), Text(shortcut.words, style)
        for hint in group.hints:
            yield "", Text(hint)
