"""What the keys do on a screen at this moment, with the user's own keys: for the help and for the list of commands."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from textual.app import App
from textual.binding import ActiveBinding
from textual.dom import DOMNode
from textual.screen import Screen

from ddenv.workbench.help.keys import shown
from ddenv.workbench.wording import plain

# What Textual brings along, in plain words: other actions of its own are of no use in a list.
BROUGHT = {
    "app.focus_next": "to the next pane, field or button, or to the one before",
    "app.focus_previous": "to the next pane, field or button, or to the one before",
    "screen.copy_text": "copy the text that is selected with the mouse",
    "cursor_up": "one line up or down",
    "cursor_down": "one line up or down",
    "page_up": "one page up or down",
    "page_down": "one page up or down",
    "first": "to the first or the last line",
    "last": "to the first or the last line",
    "scroll_top": "to the first or the last line",
    "scroll_bottom": "to the first or the last line",
    "select": "take the one under the cursor",
    "select_cursor": "take the one under the cursor",
}


@dataclass(frozen=True, slots=True)
class Shortcut:
    """`keys` as people write them; `action` is run in the name of `node`."""

    keys: str
    words: str
    action: str
    node: DOMNode
    id: str


@dataclass(frozen=True, slots=True)
class Group:
    """What belongs together: a pane, the screen, or the app. `hints` are lines that stand below the keys."""

    title: str
    shortcuts: tuple[Shortcut, ...]
    hints: tuple[str, ...] = ()


def groups(screen: Screen) -> list[Group]:
    """The focused pane's shortcuts first, then the screen's, then those that hold everywhere."""
    panes, own, everywhere = [], [], []
    for active in screen.active_bindings.values():
        if not _words(active):
            continue
        if isinstance(active.node, App) or (active.node is screen and not active.binding.id):
            everywhere.append(active)
        else:
            (own if active.node is screen else panes).append(active)
    title, hints = _pane(screen.focused)
    found = [
        Group(title, _merged(panes), hints),
        Group("This screen", _merged(own)),
        Group("Everywhere", _merged(everywhere)),
    ]
    return [group for group in found if group.shortcuts or group.hints]


def commands(screen: Screen) -> list[Shortcut]:
    """All actions of ours that can be asked for now."""
    return [shortcut for group in groups(screen) for shortcut in group.shortcuts if shortcut.id]


def _merged(found: Iterable[ActiveBinding]) -> tuple[Shortcut, ...]:
    """One for each action, with all its keys."""
    keys: dict[str, list[str]] = {}
    first: dict[str, ActiveBinding] = {}
    for active in found:
        what = active.binding.id or _words(active)
        first.setdefault(what, active)
        keys.setdefault(what, []).append(active.binding.key)
    return tuple(
        Shortcut(
            shown(",".join(keys[what])), _words(active), active.binding.action, active.node, active.binding.id or ""
        )
        for what, active in first.items()
    )


def _words(active: ActiveBinding) -> str:
    binding = active.binding
    if not binding.id:
        return BROUGHT.get(binding.action, "")
    return plain(active.tooltip or binding.tooltip or binding.description)


def _pane(focused: DOMNode | None) -> tuple[str, tuple[str, ...]]:
    """What the focused pane calls itself, and what it says of itself beside its keys."""
    if focused is None:
        return "Here", ()
    nodes = focused.ancestors_with_self
    title = next((str(title) for node in nodes if (title := getattr(node, "border_title", None))), "Here")
    # By Textual's custom a widget says in HELP what it is for.
    hints = (focused.HELP or "").splitlines() if "HELP" in vars(type(focused)) else []
    return plain(title), tuple(plain(line) for line in hints if line.strip())
