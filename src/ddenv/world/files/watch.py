"""How far the cutting of meshes is, for the user who waits for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

# Is told again and again, in words, how far it is: "" while it has not taken long, and at its end.
# What it raises ends the cutting.
Watch = Callable[[str], object]
# The one of this thread.
WATCH: ContextVar[Watch] = ContextVar("WATCH", default=lambda words: None)


@contextmanager
def watched(watch: Watch) -> Iterator[None]:
    """Lets `watch` know while this thread waits."""
    token = WATCH.set(watch)
    try:
        yield
    finally:
        WATCH.reset(token)
