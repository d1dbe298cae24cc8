"""How far the cutting of meshes is, for the user who waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# Called several times a second with words that say how far the cutting is: "" in its first second
# and at its end. An exception that it raises ends the cutting.
Watch = Callable[[str], object]
# The one of this thread.
WATCH: ContextVar[Watch] = ContextVar("WATCH", default=lambda words: None)


@contextmanager
def watched(watch: Watch) -> Iterator[None]:
    """Calls `watch` while this thread cuts meshes."""
    token = WATCH.set(watch)
    try:
        yield
    finally:
        WATCH.reset(token)
