"""A worker process, from both sides: it prepares the simulator once, and then runs one test at a
time. What it prints goes to the log.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ddenv.errors import UserError
from ddenv.robot.external.process import MOST_LEFT, PIECE, Complaints, signal_name
from ddenv.robot.external.python_simulator import PythonSimulator
from ddenv.robot.external.simulator import ExternalSimulator
from ddenv.robot.result import Ends, PoseRow, Progress, RunResult, Simulator
from ddenv.robot.settled import Settled
from ddenv.text import printable
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.numbers import part_of

if TYPE_CHECKING:
    from ddenv.robot.simulation.plant_cache import PlantCache

NICENESS = 5
# Time between two moments of a running test, s.
PERIOD = 0.1
# The maximum length of the reason why a simulator broke, in characters.
REASON = 400
# How many of its last lines are kept in the reason why a worker died, and how much of a test's
# output the log gets, bytes.
LAST_LINES = 3
LOGGED = 100_000
LEFT_OUT = b"\n(the rest of what this test printed is left out)\n"
# How long a worker whose pipe is closed may take to end, s.
END_WAIT = 5.0
PROC = Path("/proc")

# Other values of numbers, by name.
Changes = tuple[tuple[str, float], ...]
Make = Callable[[Scenario, World, Model], Simulator]


@dataclass(frozen=True)
class Start:
    """Which models rest on which in the settled world, as (upper, lower), and how it settled.
    `ties` are pairs of a model and one that it is tied to, without which it would move by itself.
    None: nothing is known without a test.
    """

    supports: list[tuple[str, str]]
    settled: Settled
    ties: list[tuple[str, str]] | None = None


@dataclass(frozen=True, kw_only=True)
class Run:
    """Asks for a test. With `ends` it may end early, see `Simulator.run`. `changes` have other
    values by name. It may take `limit` s of real time, without its preparation; None for what the
    scenario says.
    """

    keep: frozenset[str]
    seed: int
    ends: Ends | None = None
    limit: float | None = None
    changes: Changes = ()


@dataclass(frozen=True)
class Settle:
    """Asks how the world settles, and which of `elements` rest on which then. The user's own
    simulator cannot say.
    """

    elements: frozenset[str]


Task = Run | Settle


@dataclass(frozen=True)
class Ready:
    """The worker has prepared, and takes its first task."""


@dataclass(frozen=True)
class Broken:
    """A test without a result: `outcome` is "timeout" (wall clock) or "error" (its worker died, or
    an exception ended it).
    """

    outcome: str
    failure: str


# What a test ends in, beside its number where several run; and what asks whether it is known how
# the world settles, until it is.
Result = RunResult | Broken
Ended = tuple[int, Result]
AskSettled = Callable[[], Start | Broken | None]


@dataclass(frozen=True)
class Moment:
    """A test goes on: `time` s are simulated; the robot and the models that have moved are there.
    It began at `begun`, s of `time.monotonic`.
    """

    begun: float
    time: float
    pose: PoseRow
    models: Mapping[str, PoseRow]


# A UserError says why the world cannot be simulated.
Answer = Ready | Moment | RunResult | Start | Broken | UserError


def simulator_of(scenario: Scenario, world: World, robot: Model) -> Simulator:
    """The simulator that a scenario asks for. Raises UserError if the world cannot be simulated."""
    if scenario.oracle is not None:
        return (PythonSimulator if scenario.oracle.use else ExternalSimulator)(world, scenario)
    # Drake takes a second to load, and users of another simulator may not have it.
    from ddenv.robot.simulation.plant_cache import PlantCache

    return PlantCache(world, robot, scenario)


def work(line: Connection, output: Connection, parts: Any) -> None:
    """Answers the tasks that come over `line`, one at a time, until it is closed; whatever is
    printed goes to `output`.

    `parts` has what to make the simulator with, pickled in shared memory.
    """
    _settle_in(output)
    make, of = pickle.loads(bytes(parts))
    try:
        simulator: Simulator | Exception = make(*of)
    # It is raised by every task: a worker that cannot even start would be taken for one that was
    # killed.
    except Exception as error:
        simulator = error
    line.send(Ready())

    @lru_cache(maxsize=1)
    def with_changes(keep: frozenset[str], changes: Changes) -> Simulator:
        """The simulator of a world in which numbers have other values, made anew of what it
        keeps.
        """
        scenario, world, robot = of
        made: Simulator = make(*part_of(scenario, world, keep, dict(changes)), robot)
        return made

    while True:
        try:
            task = line.recv()
        except (EOFError, OSError):
            return
        there = simulator
        if isinstance(task, Run) and task.changes and not isinstance(simulator, Exception):
            try:
                there = with_changes(task.keep, task.changes)
            # It breaks this test, not all of them.
            except Exception as error:
                there = ValueError(str(error))
        answer = answered(task, there, line.send)
        line.send(answer)
        if isinstance(answer, Broken):
            # Nobody knows what an exception has left behind in the simulator.
            os._exit(1)


def _settle_in(output: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Simulations take all cores; a screen on the same machine needs little, and a user waits for
    # it.
    os.nice(NICENESS)
    # Output printed here, also by native code, must not mix with the caller's output, which
    # programs read.
    for stream in (1, 2):
        os.dup2(output.fileno(), stream)
    output.close()
    parent = os.getppid()

    def follow() -> None:
        """Ends the worker when its engine is killed: nobody would use its results."""
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def answered(
    task: Task, simulator: Simulator | Exception, tell: Callable[[Moment], object]
) -> Answer:
    """Does a task, and tells the moments of a test. The traceback of what nobody foresaw is
    printed.
    """
    try:
        if isinstance(simulator, Exception):
            raise simulator
        if isinstance(task, Settle):
            world = cast("PlantCache", simulator)
            return Start(world.supports(task.elements), world.settled(), world.ties(task.elements))
        if isinstance(simulator, ExternalSimulator):
            # It ends a test itself, and says why.
            simulator.limit = task.limit or simulator.limit
        return simulator.run(task.keep, task.seed, _progress(tell), task.ends)
    # Drake raises SystemExit when one of its own checks fails.
    except BaseException as error:
        if error is simulator and isinstance(error, UserError):
            return error
        # A UserError says all that a user can mend.
        if not isinstance(error, UserError):
            traceback.print_exception(error)
            sys.stderr.flush()
        return Broken("error", reason_of(error))


def _progress(tell: Callable[[Moment], object]) -> Progress:
    """Tells how far a test is, at its start and then every `PERIOD`."""
    begun = due = 0.0
    starts: Mapping[str, PoseRow] = {}

    def report(time_s: float, pose: PoseRow, models: Mapping[str, PoseRow]) -> None:
        nonlocal begun, due, starts
        now = time.monotonic()
        if not begun or time_s == 0.0:
            # What came before, such as rehearsals of piles, or a start in a plant that was too
            # small, is not the test's own time.
            begun = now
            due = now
            starts = models
        if now >= due:
            due = now + PERIOD
            tell(
                Moment(
                    begun,
                    time_s,
                    pose,
                    {name: at for name, at in models.items() if at != starts.get(name)},
                )
            )

    return report


def reason_of(error: BaseException) -> str:
    """An exception in one line."""
    text = " ".join(str(error).split())
    if isinstance(error, UserError):
        words = text
    else:
        words = f"{type(error).__name__}{': ' if text else ''}{text}"
    return printable(words)[:REASON]


# As the engine sees it.


class WorkerProcess:
    """A process that runs `work`. Answers come over one pipe, output over another; each wakes up
    who waits for its `handles`.
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
        self._said = Complaints()
        self._logged = 0
        self._silent = False

    @property
    def pid(self) -> int:
        return self._process.pid or 0

    @property
    def handles(self) -> list[Connection | int]:
        """What `multiprocessing.connection.wait` can wait for."""
        return [self._line, self._process.sentinel, *([] if self._silent else [self._output])]

    def give(self, task: Task) -> None:
        """Hands over a task. Does nothing if the worker is dead; that is seen by its handles."""
        self._said = Complaints()
        self._logged = 0
        with suppress(OSError):
            self._line.send(task)

    def answer(self) -> Answer | None:
        """What it has answered since; None if nothing. Raises EOFError if it is dead and will not
        answer any more.
        """
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
            left = LOGGED - self._logged
            self._logged += len(piece)
            if left >= 0:
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
        said = self._said.last_lines(LAST_LINES)
        how = f"exit code {code}" if code is None or code >= 0 else signal_name(-code)
        # Nobody else kills workers.
        perhaps = ", perhaps out of memory" if code == -signal.SIGKILL else ""
        return f"{how}{perhaps}{': ' if said else ''}{' | '.join(said)}"

    def _end(self) -> None:
        self._process.join()
        for each in (self._line, self._output, self._process):
            each.close()

    def memory(self) -> int:
        """The memory in use by it and by what it has started, without what they share with others,
        bytes; 0 if unknown.
        """
        used = 0
        for pid in _family(self.pid):
            with suppress(OSError, ValueError):
                _, resident, shared = (PROC / str(pid) / "statm").read_text().split()[:3]
                used += (int(resident) - int(shared)) * os.sysconf("SC_PAGE_SIZE")
        return used


def _family(pid: int) -> Iterator[int]:
    yield pid
    with suppress(OSError, ValueError):
        for thread in (PROC / str(pid) / "task").iterdir():
            for child in (thread / "children").read_text().split():
                yield from _family(int(child))
