"""Calls from a thread back to the screen that started it, if it is still open."""

from __future__ import annotations

from collections.abc import Callable

from textual.dom import DOMNode
from textual.widget import Widget

from ddenv.text import plain


def is_open(node: DOMNode) -> bool:
    """Whether a widget still exists with all its children: a screen that is being closed loses them
    one by one.
    """
    return node.is_attached and node.screen.display


def refuse(node: Widget, why: str) -> None:
    """Says for a moment why something is not possible."""
    node.notify(plain(why), severity="warning", timeout=4, markup=False)


def call_if_open(node: DOMNode, callback: Callable[..., object], *words: object) -> None:
    """Calls `callback(*words)` in the app's thread, from another thread, unless `node` is
    closed.
    """

    def call() -> None:
        if is_open(node):
            callback(*words)

    node.app.call_from_thread(call)
