"""A command as a process, started through the supervisor, which ends it whatever happens to this process."""

from __future__ import annotations

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ddenv.errors import printable

SUPERVISOR = Path(__file__).with_name("supervise.py")
PIECE = 65536
# How often a command is looked at that prints nothing, s.
TICK = 0.2
# How long the supervisor may take to end a command that was asked to, s: longer than it gives the command.
STOP_WAIT = 10.0
# What may still lie in a pipe when the command has ended.
MOST_LEFT = 16 * PIECE
# How much of the end of what a command complains is kept, in bytes, and how much of its last line told, in characters.
KEPT = 16384
SHOWN = 200
# Python exits with 1 for an exception that nobody catches, and says so with this line.
TRACEBACK = b"Traceback (most recent call last):"
STOPPED = b"KeyboardInterrupt"


@dataclass(frozen=True)
class Ended:
    """How a command ended: with the exit code `code`, or without one for a `reason`; and the last line that it wrote to stderr.

    `raised` tells whether that is the last one of an exception's traceback.
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

    def last_line(self) -> str:
        lines = [line.strip() for line in self._end.decode(errors="replace").splitlines()]
        last = next((line for line in reversed(lines) if line), "")
        return printable(last if len(last) <= SHOWN else f"{last[: SHOWN - 3]}...")

    def is_exception(self) -> bool:
        """Whether they end with an exception's traceback. That of one who was interrupted only says that all is over."""
        _, found, after = self._end.rpartition(TRACEBACK)
        not_indented = [line for line in after.splitlines() if line.strip() and not line.startswith(b" ")]
        return bool(found) and len(not_indented) <= 1 and not any(line.startswith(STOPPED) for line in not_indented)


@dataclass(frozen=True)
class Running:
    """A command in the hands of its supervisor, which `line` leads to."""

    supervisor: subprocess.Popen
    line: socket.socket


@contextlib.contextmanager
def running(words: Sequence[str], folder: Path, environment: Mapping[str, str], temporary: Path) -> Iterator[Running]:
    """The command, started in `folder`; at the end nothing that it started is left, and the folder `temporary` is gone.

    So it is if this process is killed. Raises OSError where no program can be started.
    """
    ours, theirs = socket.socketpair()
    start = [sys.executable, "-I", "-S", str(SUPERVISOR), str(temporary), *words]
    streams = {"stdin": theirs, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with ours:
        with theirs:
            supervisor = subprocess.Popen(
                start, **streams, cwd=folder, env=environment, start_new_session=True, bufsize=0
            )
        with supervisor.stdout, supervisor.stderr:
            try:
                yield Running(supervisor, ours)
            finally:
                ours.close()
                _end(supervisor)


def _end(supervisor: subprocess.Popen) -> None:
    """The supervisor ends by itself once its line is closed."""
    try:
        supervisor.wait(STOP_WAIT)
    except subprocess.TimeoutExpired:
        supervisor.kill()
        supervisor.wait()


def watch(command: Running, seconds: float, take: Callable[[bytes], None], too_much: Callable[[], str]) -> Ended:
    """Waits for the command's end, at most `seconds` of wall clock. All that it prints is read.

    `take` is given what it writes to stdout; as soon as `too_much()` has a reason for it, the command is ended early.
    """
    complaints = Complaints()
    takers = {command.supervisor.stdout: take, command.supervisor.stderr: complaints.add}
    deadline = time.monotonic() + seconds
    said, why = None, ""
    with selectors.DefaultSelector() as selector:
        for source in (command.line, *takers):
            selector.register(source, selectors.EVENT_READ)
        while said is None:
            said = _look(selector, command, takers)
            late = f"took longer than {seconds:g} s of wall clock" if time.monotonic() > deadline else ""
            if said is None and not why and (why := late or too_much()):
                _ask_to_end(command)
                deadline = time.monotonic() + STOP_WAIT
            elif said is None and late:
                # It was stopped itself, and will be killed.
                said = ""
    for stream, taker in takers.items():
        _drain(stream, taker)
    code, reason = _read(said)
    return Ended(None if why else code, why or reason, complaints.last_line(), complaints.is_exception())


def _look(
    selector: selectors.BaseSelector, command: Running, takers: Mapping[IO[bytes], Callable[[bytes], None]]
) -> str | None:
    """Takes what there is; returns what the supervisor says in the end, and "" if it says nothing any more."""
    for key, _ in selector.select(TICK):
        if key.fileobj is command.line:
            with contextlib.suppress(OSError):
                return command.line.recv(64).decode()
            return ""
        if piece := os.read(key.fd, PIECE):
            takers[key.fileobj](piece)
        else:
            selector.unregister(key.fileobj)
    return None


def _ask_to_end(command: Running) -> None:
    with contextlib.suppress(OSError):
        command.line.send(b".")


def _drain(stream: IO[bytes], take: Callable[[bytes], None]) -> None:
    """Takes what was written before the command ended, and does not wait for more."""
    os.set_blocking(stream.fileno(), False)
    with contextlib.suppress(BlockingIOError):
        for _ in range(MOST_LEFT // PIECE):
            take(os.read(stream.fileno(), PIECE))


def _read(said: str) -> tuple[int | None, str]:
    """What the supervisor said, as an exit code or the reason for the lack of one."""
    kind, _, number = said.partition(" ")
    match kind:
        case "exit":
            return int(number), ""
        case "signal":
            return None, f"the command was ended by {_signal_name(int(number))}"
        case "error":
            return None, f"the command cannot be started: {os.strerror(int(number))}"
    return None, "the command's supervisor was killed"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
