"""The keys of a screen as a table."""

from __future__ import annotations

from textual.binding import Binding, BindingType

HELP = ("help", "question_mark,f1", "app.help", "help", "show every key", "?")
# Of every screen with a map.
MAP_KEYS = (
    ("closer", "plus,equals_sign", "app.map('zoom', 1.25)", "closer", "map: closer", "+"),
    ("farther", "minus", "app.map('zoom', 0.8)", "farther", "map: farther away", "-"),
    ("fit", "0", "app.map('fit')", "fit", "map: show all that matters"),
)


def keys(screen: str, *rows: tuple[str, ...], priority: bool = False) -> list[BindingType]:
    """The bindings of a screen or a pane, whose names in the file of keys begin with `screen`.

    A row has the name, the keys, the action, its word in the footer, what the help says, and maybe
    how the footer writes the key. With `priority` they come before those of what has the focus.
    """
    found: list[BindingType] = []
    for name, each, action, word, words, *display in rows:
        shown = display[0] if display else None
        found.append(
            Binding(
                each,
                action,
                word,
                True,
                shown,
                priority=priority,
                tooltip=words,
                id=f"{screen}.{name}",
            )
        )
    return found


def ids(screen: str, names: str) -> tuple[str, ...]:
    """The ids of some of them, for the footer; one with a dot in it is of a pane."""
    return tuple(name if "." in name else f"{screen}.{name}" for name in names.split())
