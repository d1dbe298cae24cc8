"""Runs a command through a supervisor, which ends it whatever happens to this process."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ddenv.robot.deadline import Stopwatch
from ddenv.text import printable

SUPERVISOR = Path(__file__).with_name("supervise.py")
BEGIN = b"+"
END = b"."
PIECE = 65536
TICK = 0.2  # how often a silent command is checked, s
# The maximum time between two checks that counts, s: it is longer where we were stopped ourselves.
LONGEST_LOOK = 1.0
# How long the supervisor may take to end a command, s: longer than the grace that it gives the
# command.
STOP_WAIT = 10.0
MOST_LEFT = 16 * PIECE  # the maximum that can be left in a pipe when the command has ended, bytes
# How much of the end of stderr is kept, in bytes, and how much of its last line is reported, in
# characters.
KEPT = 16384
SHOWN = 200
# Python exits with 1 for an exception that nobody catches, and says so with this line.
TRACEBACK = b"Traceback (most recent call last):"
STOPPED = b"KeyboardInterrupt"


@dataclass(frozen=True)
class Ended:
    """How a command ended: with the exit code `code`, or without one for a `reason`.

    `complaint` is the last line that it wrote to stderr; `raised` is True if that line ends an
    exception's traceback.
    """

    code: int | None
    reason: str
    complaint: str
    raised: bool = False


class Complaints:
    """The end of what a command writes to stderr."""

    def __init__(self) -> None:
        self._end = b""

    def add(self, piece: bytes) -> None:
        self._end = (self._end + piece)[-KEPT:]

    def last_lines(self, most: int) -> list[str]:
        """At most so many lines that are not empty, each shortened."""
        lines = [line.strip() for line in self._end.decode(errors="replace").splitlines()]
        last = [line for line in lines if line][-most:]
        return [
            printable(line if len(line) <= SHOWN else f"{line[: SHOWN - 3]}...") for line in last
        ]

    def is_exception(self) -> bool:
        """Whether it ends with a traceback. That of an interrupted program does not count: it only
        says that it was stopped.
        """
        _, found, after = self._end.rpartition(TRACEBACK)
        not_indented = [
            line for line in after.splitlines() if line.strip() and not line.startswith(b" ")
        ]
        return (
            bool(found)
            and len(not_indented) <= 1
            and not any(line.startswith(STOPPED) for line in not_indented)
        )


@dataclass(frozen=True)
class Running:
    """A command under its supervisor. `line` is the socket to the supervisor, `stdout` and `stderr`
    are the command's output.
    """

    line: socket.socket
    stdout: IO[bytes]
    stderr: IO[bytes]

    def say(self, word: bytes) -> None:
        """Has the supervisor start the command (`BEGIN`: its files are written), or end it early
        (`END`).
        """
        with contextlib.suppress(OSError):
            self.line.send(word)


@contextlib.contextmanager
def running(
    words: Sequence[str], folder: Path, environment: Mapping[str, str], temporary: Path
) -> Iterator[Running]:
    """The command `words`, which starts in `folder` at `BEGIN`.

    At the end, nothing that the command started is left, and the folder `temporary` is removed,
    even if this process is killed while it writes there. Raises OSError if no program can be
    started.
    """
    ours, theirs = socket.socketpair()
    start = [sys.executable, "-I", "-S", str(SUPERVISOR), str(temporary), *words]
    with ours:
        with theirs:
            supervisor = subprocess.Popen(
                start,
                stdin=theirs.fileno(),
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                cwd=folder,
                env=environment,
                start_new_session=True,
                bufsize=0,
            )
        stdout = supervisor.stdout
        stderr = supervisor.stderr
        assert stdout is not None and stderr is not None
        with stdout, stderr:
            try:
                yield Running(ours, stdout, stderr)
            finally:
                # The supervisor ends by itself once its socket is closed.
                ours.close()
                try:
                    supervisor.wait(STOP_WAIT)
                except subprocess.TimeoutExpired:
                    supervisor.kill()
                    supervisor.wait()


def watch(
    command: Running, seconds: float, take: Callable[[bytes], None], too_much: Callable[[], str]
) -> Ended:
    """Waits for the command's end, for a maximum of `seconds` of wall clock, and reads all its
    output.

    `take` gets what the command writes to stdout. As soon as `too_much()` returns a reason, the
    command is ended early.
    """
    complaints = Complaints()
    takers = ((command.stdout, take), (command.stderr, complaints.add))
    limit = seconds
    clock = Stopwatch(LONGEST_LOOK)
    said = None
    why = ""
    with selectors.DefaultSelector() as selector:
        selector.register(command.line, selectors.EVENT_READ)
        for stream, taker in takers:
            selector.register(stream, selectors.EVENT_READ, taker)
        while said is None:
            for key, _ in selector.select(TICK):
                if key.fileobj is command.line:
                    # Its final message; "" if it ended without one.
                    said = ""
                    with contextlib.suppress(OSError):
                        said = command.line.recv(64).decode()
                elif piece := os.read(key.fd, PIECE):
                    key.data(piece)
                else:
                    selector.unregister(key.fileobj)
            late = f"took longer than {seconds:g} s of wall clock" if clock.look() > limit else ""
            if said is None and not why and (why := late or too_much()):
                command.say(END)
                limit = STOP_WAIT
                clock = Stopwatch(LONGEST_LOOK)
            elif said is None and late:
                # The supervisor itself was stopped, and will be killed.
                said = ""
    for stream, taker in takers:
        # What was written before the command ended, without waiting for more.
        os.set_blocking(stream.fileno(), False)
        with contextlib.suppress(BlockingIOError):
            for _ in range(MOST_LEFT // PIECE):
                taker(os.read(stream.fileno(), PIECE))
    code, reason = _read(said)
    return Ended(
        None if why else code,
        why or reason,
        "".join(complaints.last_lines(1)),
        complaints.is_exception(),
    )


def _read(said: str) -> tuple[int | None, str]:
    """The exit code in the supervisor's message, or None and the reason why there is none."""
    kind, _, number = said.partition(" ")
    match kind:
        case "exit":
            return int(number), ""
        case "signal":
            return None, f"the command was ended by {signal_name(int(number))}"
        case "error":
            return None, f"the command cannot be started: {os.strerror(int(number))}"
    return None, "the command's supervisor was killed"


def signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
