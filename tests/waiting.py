"""How tests wait for what other programs, threads and screens do."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable
from inspect import isawaitable

# Only what hangs takes so long (s): a slow machine is no bug. One that does other work at the same
# time needs more.
PATIENCE = float(os.environ.get("DDENV_PATIENCE", "300"))
# Between two looks (s).
PERIOD = 0.02


def wait_until(true: Callable[[], object], what: Callable[[], object] = str) -> None:
    """Returns when `true()` holds. Raises AssertionError with `what()` when it never does."""
    deadline = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < deadline, what()
        time.sleep(PERIOD)


async def eventually(true: Callable[[], object], what: Callable[[], object] = str) -> None:
    """As `wait_until`, while the event loop goes on; what `true()` gives may have to be awaited."""
    deadline = time.monotonic() + PATIENCE
    while not (await found if isawaitable(found := true()) else found):
        assert time.monotonic() < deadline, what()
        await asyncio.sleep(PERIOD)
