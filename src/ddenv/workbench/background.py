"""From a thread back to the screen that started it, which may have been closed meanwhile."""

from __future__ import annotations

from collections.abc import Callable

from textual.dom import DOMNode


def is_open(node: DOMNode) -> bool:
    """Whether a widget is still there with all its children: a screen that is being closed loses them one by one."""
    return node.is_attached and node.screen.display


def call_if_open(node: DOMNode, callback: Callable[..., object], *words: object) -> None:
    """Calls `callback(*words)` in the app's own thread, from another one, unless `node` is closed."""

    def call() -> None:
        if is_open(node):
            callback(*words)

    node.app.call_from_thread(call)
