"""Programs that are measured: in a terminal of their own (a pty of 120x36 with 16 million colours),
and their memory.
"""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import signal
import struct
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SIZE = (120, 36)  # columns, rows
KIND = {"TERM": "xterm-256color", "COLORTERM": "truecolor"}
# Escape sequences: strings such as titles, sequences with numbers, and single letters.
ESCAPES = re.compile(rb"\x1b[\]P_][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b\[[0-9;:<=>?$ ]*[@-~]|\x1b.")


class Terminal:
    """Starts `words` in a terminal. Times are those of `time.perf_counter`, s; `started` is just
    before the program is.
    """

    def __init__(self, words: list[str], environment: dict[str, str]) -> None:
        columns, rows = SIZE
        self.writes: list[tuple[float, bytes]] = []
        self.started = time.perf_counter()
        self.id, self._handle = pty.fork()
        if self.id == 0:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
            os.execvpe(words[0], words, environment | KIND)

    def look(self, seconds: float) -> bool:
        """Waits a limited time for output, and reads it. Raises EOFError when the program is
        gone.
        """
        if not select.select([self._handle], [], [], max(0.0, seconds))[0]:
            return False
        try:
            written = os.read(self._handle, 65536)
        except OSError:
            written = b""
        if not written:
            raise EOFError(b"".join(text for _, text in self.writes).decode(errors="replace"))
        self.writes.append((time.perf_counter(), written))
        return True

    def watch(self, seconds: float) -> None:
        """Reads all output for some seconds."""
        deadline = time.perf_counter() + seconds
        while (left := deadline - time.perf_counter()) > 0:
            self.look(left)

    def settle(self, quiet: float, seconds: float) -> float:
        """Waits until nothing was written for `quiet` seconds; returns when the last write came."""
        deadline = time.perf_counter() + seconds
        while time.perf_counter() < deadline and self.look(quiet):
            pass
        return self.writes[-1][0]

    def letters(self) -> int:
        """How many letters and digits were written."""
        return len(
            re.findall(rb"[A-Za-z0-9]", ESCAPES.sub(b"", b"".join(text for _, text in self.writes)))
        )

    def press(self, key: str) -> float:
        """Returns when."""
        at = time.perf_counter()
        os.write(self._handle, key.encode())
        return at

    def leave(self) -> None:
        """Asks the program to end, and makes it."""
        with suppress(OSError, EOFError):
            self.press("\x11")
            self.watch(3.0)
        with suppress(ProcessLookupError):
            os.kill(self.id, signal.SIGKILL)
        os.waitpid(self.id, 0)
        os.close(self._handle)


@contextmanager
def largest(session: int) -> Iterator[list[float]]:
    """Appends the memory of all processes of a session, bytes, five times a second."""
    found, done = [0.0], threading.Event()

    def look() -> None:
        while not done.wait(0.2):
            found.append(
                sum(
                    memory_of(process)
                    for process in Path("/proc").glob("[0-9]*")
                    if of(process, session)
                )
            )

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield found
    finally:
        done.set()
        thread.join()


def of(process: Path, session: int) -> bool:
    try:
        return int((process / "stat").read_text().rpartition(")")[2].split()[3]) == session
    except OSError:
        return False


def memory_of(process: Path) -> float:
    """Memory in use, where a page that n processes share counts 1 / n, bytes."""
    try:
        lines = (process / "smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith("Pss:")), 0.0)
