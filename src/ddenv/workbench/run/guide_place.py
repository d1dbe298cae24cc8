"""The moment that a guiding screen shows, in a file beside the run. Screens that only watch follow it, as a class its teacher."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from ddenv.runfile.position import Position

SUFFIX = ".place"
FOLLOWS = "watching only: no key changes anything; follows the guiding screen"
OWN_WAY = "watching only, at a moment of your own: escape follows the guiding screen"


def place_file(run: Path) -> Path:
    """Where the guiding screen of a run writes its moment."""
    return run.with_name(f"{run.name}{SUFFIX}")


class GuidePlace:
    """Writes the moment of a screen's `position`, or, if it only watches, brings it to the moment that was written.

    A screen that watches gives `browse`: `browse(move)` shows the moment to which `move()` goes.
    """

    def __init__(
        self, run: Path, position: Position, browse: Callable[[Callable[[], str]], None] | None = None
    ) -> None:
        self._file, self._position, self._browse = place_file(run), position, browse
        self._follows, self._led, self._written = True, False, False
        # What was read last, and when it had been written.
        self._read: tuple[int | None, int] = (None, 0)

    @property
    def words(self) -> str:
        """What a screen says that only watches."""
        return FOLLOWS if self._follows else OWN_WAY

    def browsed(self) -> bool:
        """The screen went to another moment. Returns whether it may say something else now."""
        at = self._position.at
        if self._browse is None:
            self._write(at)
        elif not self._led:
            # Back at its end it follows again.
            self._follows, self._read = at is None, (None, 0)
        return self._browse is not None

    def look(self) -> None:
        """Goes where the guiding screen has gone since the last look."""
        if self._browse is None or not self._follows:
            return
        before, self._read = self._read, self._read_place()
        at = self._read[0]
        if self._read != before and at != self._position.at:
            self._led = True
            self._browse(lambda: self._go(at))
            self._led = False

    def _go(self, at: int | None) -> str:
        self._position.go(at)
        return ""

    def close(self) -> None:
        """The guiding screen is gone: nobody follows it any more."""
        if self._written:
            with suppress(OSError):
                self._file.unlink(missing_ok=True)

    def _write(self, at: int | None) -> None:
        new = self._file.with_name(f".{self._file.name}.{os.getpid()}")
        # Where nothing can be written, nobody follows.
        try:
            new.write_text(json.dumps(at))
            new.replace(self._file)
            self._written = True
        except OSError:
            with suppress(OSError):
                new.unlink(missing_ok=True)

    def _read_place(self) -> tuple[int | None, int]:
        try:
            when = self._file.stat().st_mtime_ns
            if when == self._read[1]:
                return self._read
            at = json.loads(self._file.read_bytes()[:100])
        except (OSError, ValueError):
            return None, 0
        return (at if isinstance(at, int) and not isinstance(at, bool) and at > 0 else None), when
