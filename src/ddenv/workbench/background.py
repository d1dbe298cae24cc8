"""What is done beside the screen, in threads, and what they tell it: it may have been closed meanwhile."""

from __future__ import annotations

from collections.abc import Callable

from textual.dom import DOMNode


def is_open(node: DOMNode) -> bool:
    """Whether a widget is there still with all that is in it: of a screen that is being closed they go one by one."""
    return node.is_attached and node.screen.display


def tell(node: DOMNode, callback: Callable[..., object], *words: object) -> None:
    """Calls `callback(*words)` in the app's own thread, from another one, unless `node` has gone."""

    def call() -> None:
        if is_open(node):
            callback(*words)

    node.app.call_from_thread(call)
