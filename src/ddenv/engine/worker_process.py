"""One worker process, as the engine sees it: it is given tasks, answers them, and is killed; what it prints goes to the log."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import Any

from ddenv.engine.worker import Answer, Task, work
from ddenv.robot.external.process import MOST_LEFT, PIECE, Complaints, signal_name

# How many of its last lines are kept in the reason why a worker died, and how much of a test's output the log gets, bytes.
LAST_LINES, LOGGED = 3, 100_000
LEFT_OUT = b"\n(the rest of what this test printed is left out)\n"
# How long a worker whose pipe is closed may take to end, s.
END_WAIT = 5.0
PROC = Path("/proc")


class WorkerProcess:
    """A process that runs `work`. Its answers come over one pipe, and what it prints over another: no output can be taken for an
    answer, and each wakes up whoever waits for its `handles`.
    """

    def __init__(self, context: SpawnContext, parts: Any) -> None:
        self._line, theirs = context.Pipe()
        self._output, printed = context.Pipe(duplex=False)
        os.set_blocking(self._output.fileno(), False)
        # Daemons are killed if this process ends by an exception.
        self._process = context.Process(target=work, args=(theirs, printed, parts), daemon=True)
        self._process.start()
        theirs.close()
        printed.close()
        self._said, self._logged, self._silent = Complaints(), 0, False

    @property
    def pid(self) -> int:
        pid = self._process.pid
        assert pid is not None
        return pid

    @property
    def handles(self) -> list[Connection | int]:
        """What `multiprocessing.connection.wait` can wait for."""
        return [self._line, self._process.sentinel, *([] if self._silent else [self._output])]

    def give(self, task: Task) -> None:
        """Hands over a task. Does nothing if the worker is dead; that is seen by its handles."""
        self._said, self._logged = Complaints(), 0
        with suppress(OSError):
            self._line.send(task)

    def answer(self) -> Answer | None:
        """What it has answered since; None if nothing. Raises EOFError if it is dead and will not answer any more."""
        self._listen()
        try:
            if self._line.poll():
                answer: Answer = self._line.recv()
                return answer
        except OSError:
            raise EOFError from None
        if wait([self._process.sentinel], 0.0):
            # It may have answered before it died.
            if self._line.poll():
                return self.answer()
            raise EOFError
        return None

    def _listen(self) -> None:
        """Takes some of what it has printed: it may print for ever."""
        if self._silent:
            return
        with suppress(BlockingIOError):
            piece = os.read(self._output.fileno(), PIECE)
            self._silent = not piece
            self._said.add(piece)
            self._log(piece)

    def _log(self, piece: bytes) -> None:
        left = LOGGED - self._logged
        if left < 0:
            return
        self._logged += len(piece)
        with suppress(OSError):
            os.write(2, piece if len(piece) <= left else piece[:left] + LEFT_OUT)

    def kill(self) -> None:
        """Ends it at once, whatever it does. Does nothing if it has ended."""
        if not self._line.closed:
            self._process.kill()
            self._end()

    def died(self) -> str:
        """How it ended by itself, after `answer` has raised EOFError: "SIGSEGV: its last lines"."""
        self._process.join(END_WAIT)
        self._process.kill()
        self._process.join()
        code = self._process.exitcode
        for _ in range(MOST_LEFT // PIECE):
            self._listen()
        self._end()
        return _words(0 if code is None else code, self._said.last_lines(LAST_LINES))

    def _end(self) -> None:
        self._process.join()
        self._line.close()
        self._output.close()
        self._process.close()

    def memory(self) -> int:
        """The memory in use by it and by what it has started, bytes; 0 where that is not known."""
        return sum(_resident(pid) for pid in _family(self.pid))


def _words(code: int, said: list[str]) -> str:
    how = f"exit code {code}" if code >= 0 else signal_name(-code)
    # Nobody else kills workers.
    perhaps = ", perhaps for lack of memory" if code == -signal.SIGKILL else ""
    return f"{how}{perhaps}{': ' if said else ''}{' | '.join(said)}"


def _family(pid: int) -> Iterator[int]:
    """A process and all that it has started."""
    yield pid
    with suppress(OSError, ValueError):
        for thread in (PROC / str(pid) / "task").iterdir():
            for child in (thread / "children").read_text().split():
                yield from _family(int(child))


def _resident(pid: int) -> int:
    """The memory of one process, without what it shares with others, bytes."""
    try:
        _, resident, shared = (PROC / str(pid) / "statm").read_text().split()[:3]
    except (OSError, ValueError):
        return 0
    return (int(resident) - int(shared)) * os.sysconf("SC_PAGE_SIZE")
