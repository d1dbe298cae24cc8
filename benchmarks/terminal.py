"""A program in a terminal of its own (a pty), with the times of its output."""

from __future__ import annotations

import codecs
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Callable
from contextlib import suppress

from screen import Screen

SIZE = (120, 36)  # columns, rows
# As many terminals: 16 million colours, the most bytes.
KIND = {"TERM": "xterm-256color", "COLORTERM": "truecolor"}


class Terminal:
    """Starts `words` in a terminal. Times are those of `time.perf_counter`, s; `started` is just before the program is."""

    def __init__(self, words: list[str], environment: dict[str, str]) -> None:
        columns, rows = SIZE
        self.screen = Screen(columns, rows)
        self.writes: list[tuple[float, int]] = []
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self.started = time.perf_counter()
        self.id, self._handle = pty.fork()
        if self.id == 0:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
            os.execvpe(words[0], words, environment | KIND)

    def look(self, seconds: float) -> float | None:
        """Waits a limited time for output and reads it; returns when it came. Raises EOFError when the program is gone."""
        if not select.select([self._handle], [], [], max(0.0, seconds))[0]:
            return None
        try:
            written = os.read(self._handle, 65536)
        except OSError:
            written = b""
        at = time.perf_counter()
        if not written:
            raise EOFError("\n".join(line.rstrip() for line in self.screen.lines))
        self.writes.append((at, len(written)))
        self.screen.feed(self._decoder.decode(written))
        return at

    def until(self, seen: Callable[[Screen], bool], seconds: float) -> float | None:
        """When the screen first showed it, or None if it did not in time."""
        deadline = time.perf_counter() + seconds
        while (left := deadline - time.perf_counter()) > 0:
            at = self.look(left)
            if at is not None and seen(self.screen):
                return at
        return None

    def watch(self, seconds: float) -> None:
        """Reads all output for some seconds."""
        self.until(lambda _: False, seconds)

    def settle(self, quiet: float, seconds: float) -> float:
        """Waits until nothing was written for `quiet` seconds; returns when the last write came."""
        deadline = time.perf_counter() + seconds
        while time.perf_counter() < deadline and self.look(quiet) is not None:
            pass
        return self.writes[-1][0]

    def press(self, key: str) -> float:
        """Returns when."""
        at = time.perf_counter()
        os.write(self._handle, key.encode())
        return at

    def memory(self) -> float:
        """The program's memory (RSS), MB."""
        words = ["ps", "-o", "rss=", "-p", str(self.id)]
        return int(subprocess.run(words, capture_output=True, text=True, check=True).stdout) / 1024

    def leave(self) -> None:
        """Asks the program to end, and makes it."""
        with suppress(OSError, EOFError):
            self.press("\x11")
            self.watch(5.0)
        with suppress(ProcessLookupError):
            os.kill(self.id, signal.SIGKILL)
        os.waitpid(self.id, 0)
        os.close(self._handle)
