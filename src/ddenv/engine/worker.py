"""What a worker process does: prepare the simulator once, then run one test at a time in it."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import traceback
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol, cast, runtime_checkable

from ddenv.errors import UserError, printable
from ddenv.robot.result import Progress, RunResult
from ddenv.robot.settled import Settled
from ddenv.runfile.store import COLUMNS
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

NICENESS = 5
# How many bytes of the reason why a worker broke its pool can read.
REASON = 400


class Simulator(Protocol):
    """Runs the robot in parts of one world."""

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        full: bool = True,
    ) -> RunResult: ...


@runtime_checkable
class Limited(Protocol):
    """A simulator that ends a test itself after `limit` s of real time, and says why."""

    limit: float


class Settling(Protocol):
    """A simulator that lets a world come to rest.

    `ties` has each of `elements` with each other one that it is tied to: without that it would move by itself, as a ball without
    its shelf. So without a test it stays with that, or goes. None: unknown; then nothing is known without a test.
    """

    def supports(self, elements: frozenset[str]) -> list[tuple[str, str]]: ...
    def settled(self) -> Settled: ...
    def ties(self, elements: frozenset[str]) -> list[tuple[str, str]] | None: ...


@dataclass(frozen=True)
class Start:
    """What rests on what in the settled world, as (upper, lower), how it settled, and the ties of its models if they are known."""

    supports: list[tuple[str, str]]
    settled: Settled
    ties: list[tuple[str, str]] | None = None


@dataclass(frozen=True)
class Shared:
    """Memory that a pool shares with its workers, with a part for each slot.

    `progress` has `COLUMNS` doubles a slot; `begun` one, when the robot began to move, s of `time.monotonic`, and 0 before that;
    `reasons` `REASON` bytes: why the worker broke, in UTF-8.
    """

    progress: Any
    begun: Any
    reasons: Any


_simulator: Simulator | Exception
_shared: Shared


def prepare(scenario: Scenario, world: World, robot: Model, shared: Shared) -> None:
    """Runs first in every worker. An error is stored, and raised by every test: here it would only break the pool."""
    global _simulator, _shared
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Simulations take all cores; a screen on the same machine needs little, and a user waits for it.
    os.nice(NICENESS)
    # Output printed here, also by native code, must not mix with the caller's output, which programs read.
    os.dup2(2, 1)
    threading.Thread(target=_follow_parent, args=(os.getppid(),), daemon=True).start()
    _shared = shared
    try:
        _simulator = _simulator_of(scenario, world, robot)
    except Exception as error:
        _simulator = error


def _simulator_of(scenario: Scenario, world: World, robot: Model) -> Simulator:
    if scenario.oracle is not None:
        from ddenv.robot.external.simulator import ExternalSimulator

        return ExternalSimulator(world, scenario)
    # Drake takes a second to load, and users of another simulator may not have it.
    from ddenv.robot.drake.template import Variants

    return Variants(world, robot, scenario)


def run_test(keep: frozenset[str], seed: int, full: bool, limit: float, slot: int) -> RunResult:
    """One test of at most `limit` s of real time, with its progress in `slot` of the shared memory.

    Raises UserError if the world cannot be simulated. Any other exception ends the worker, with the reason in the shared
    memory: nobody knows what it has left behind in the simulator.
    """
    start, begun = slot * COLUMNS, False

    def report(time_s: float, pose: tuple[float, ...]) -> None:
        nonlocal begun
        if not begun or time_s == 0.0:
            # What came before, such as rehearsals of piles, or a start in a plant that was too small, is not the test's own time.
            _shared.begun[slot], begun = time.monotonic(), True
        _shared.progress[start : start + COLUMNS] = (time_s, *pose)

    if isinstance(_simulator, UserError):
        raise _simulator
    try:
        if isinstance(_simulator, Exception):
            raise _simulator
        if isinstance(_simulator, Limited):
            _simulator.limit = limit
        return _simulator.run(keep, seed, report, full)
    # Drake raises SystemExit when one of its own checks fails.
    except BaseException as error:
        _break(error, slot)


def settle(elements: frozenset[str], slot: int) -> Start:
    """How the world settles, and which of `elements` rest on which then. The user's own simulator cannot say.

    Raises as `run_test`.
    """
    if isinstance(_simulator, UserError):
        raise _simulator
    try:
        if isinstance(_simulator, Exception):
            raise _simulator
        world = cast(Settling, _simulator)
        return Start(world.supports(elements), world.settled(), world.ties(elements))
    except BaseException as error:
        _break(error, slot)


def _break(error: BaseException, slot: int) -> NoReturn:
    """Ends the worker. The traceback goes to the log."""
    try:
        reason, start = _reason(error), slot * REASON
        # The first byte comes last: whoever finds one finds all.
        _shared.reasons[start + 1 : start + len(reason)] = reason[1:]
        _shared.reasons[start] = reason[0]
        traceback.print_exception(error)
        sys.stderr.flush()
    finally:
        os._exit(1)


def _reason(error: BaseException) -> bytes:
    """An exception in one line of at most `REASON` bytes."""
    text = " ".join(str(error).split())
    words = text if isinstance(error, UserError) else f"{type(error).__name__}{': ' if text else ''}{text}"
    # A character that is cut in two is left out when the bytes are read.
    return printable(words).encode(errors="replace")[:REASON]


def _follow_parent(parent: int) -> None:
    """Ends the worker when its engine is killed: nobody would use its results."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
