"""Worker processes: each runs one test at a time, and is killed and replaced when it dies or takes too long."""

from __future__ import annotations

import math
import multiprocessing
import os
import pickle
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any, Protocol

from ddenv.engine.limits import GENEROUS, memory_limit, too_large
from ddenv.engine.worker import POSE, Broke, Make, Ready, Refused, Run, Settle, Shared, Start, Task, simulator_of
from ddenv.engine.worker_process import WorkerProcess
from ddenv.errors import UserError
from ddenv.robot import check_drake
from ddenv.robot.deadline import Stopwatch
from ddenv.robot.result import RunResult
from ddenv.runfile.store import COLUMNS, Live
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

# A simulated step makes a thousand small allocations: with more of them cached by glibc, a step takes 59 us, not 75.
# And a worker has one core: libraries that use threads would only slow down other workers.
FOR_DRAKE = {
    "GLIBC_TUNABLES": "glibc.malloc.tcache_count=127",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}

_one_at_a_time = threading.Lock()


class _DrakeProcess(SpawnProcess):
    """A process started with `FOR_DRAKE`: libraries read these variables before any Python code runs."""

    @staticmethod
    def _Popen(process: SpawnProcess) -> object:  # type: ignore[override]  # a private part of the standard library
        with _environment(FOR_DRAKE):
            return SpawnProcess._Popen(process)


class DrakeContext(SpawnContext):
    """Starts processes for the simulation with Drake, also in place of those that died."""

    Process = _DrakeProcess


@contextmanager
def _environment(more: Mapping[str, str]) -> Iterator[None]:
    """Adds `more` to the environment for a moment, unless the user has set it: a new process inherits it."""
    with _one_at_a_time:
        added = [name for name in more if name not in os.environ]
        os.environ.update({name: more[name] for name in added})
        try:
            yield
        finally:
            for name in added:
                del os.environ[name]


# How often a worker may die before it takes its first task, while no test ends, before the engine gives up.
MOST_BREAKS = 3
# How much longer than its time limit a test of the user's own simulator may take, s: its worker ends the command, and says why.
MARGIN = 60.0
# The maximum time of what comes before a test moves, s: large piles are rehearsed for minutes, but nothing may hang forever.
PREPARATION = 3600.0
# The maximum time between two looks that counts, s: it is longer where the engine was stopped.
LONGEST_LOOK = 1.0
# How often the memory of up to `FEW` workers is looked at, s, and that of more workers as much more rarely: a look takes a third
# of a millisecond. In this time a process fills 0.4 GB.
MEMORY_PERIOD, FEW = 0.2, 8
# The maximum time between two looks at the clocks, s.
CLOCK_PERIOD = 0.1


@dataclass(frozen=True)
class Broken:
    """A test without a result: `outcome` is "timeout" (wall clock) or "error" (its worker died or broke)."""

    outcome: str
    failure: str


@dataclass(frozen=True)
class Job:
    """A task in flight, for `test` if it is one. It may take `limit` s of real time, without its preparation."""

    test: int | None
    task: Task
    limit: float


@dataclass(frozen=True)
class Pace:
    """How far a running test is: `simulated` s in `real` s of wall clock."""

    simulated: float
    real: float


class Workers(Protocol):
    """Make tests, several at a time: processes here, or a cluster. `Pool` says what each of these does."""

    @property
    def idle(self) -> int: ...
    @property
    def busy(self) -> int: ...
    def submit(
        self, test: int, keep: frozenset[str], seed: int, full: bool = True, limit: float | None = None
    ) -> None: ...
    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]: ...
    def settle(self, elements: frozenset[str]) -> Callable[[], Start | Broken | None]: ...
    def live(self) -> list[Live]: ...
    def paces(self) -> list[Pace]: ...
    def close(self) -> None: ...


class _Slot:
    """A place for one worker, and what is known of it: whether it has prepared, its job, and how often it died before that."""

    def __init__(self, worker: WorkerProcess) -> None:
        self.worker = worker
        self.ready = False
        self.job: Job | None = None
        self.breaks = 0
        # How long the job has run, or is in preparation.
        self.clock = Stopwatch(LONGEST_LOOK)
        self.result: RunResult | Start | Broken | None = None


class Pool:
    """`jobs` workers on one scenario, each with a pipe of its own: whoever waits for a test is woken up as it ends."""

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        robot: Model,
        jobs: int,
        make: Make = simulator_of,
        at_a_time: int | None = None,
    ) -> None:
        """`make` makes the simulator in each worker. `at_a_time` tests share the machine's memory, `jobs` if not given.

        Raises UserError where Drake is needed and not installed.
        """
        # The user's own simulator gets the environment unchanged.
        self._context = DrakeContext() if scenario.oracle is None else multiprocessing.get_context("spawn")
        moving = tuple(model.name for model in world.models if not model.static)
        sizes = (jobs * COLUMNS, jobs, jobs * POSE * len(moving))
        progress, begun, models = (self._context.RawArray("d", size) for size in sizes)
        self._shared = Shared(progress, begun, models, moving)
        if scenario.oracle is None:
            check_drake()
        parts = pickle.dumps((make, (scenario, world, robot)))
        self._parts: Any = self._context.RawArray("c", len(parts))
        self._parts.raw = parts
        # A simulator of the user's own has nothing to prepare.
        self._prepares = scenario.oracle is None
        self._limit = scenario.simulation.wall_timeout or GENEROUS
        self._margin = 0.0 if scenario.oracle is None else MARGIN
        self._memory = memory_limit(scenario, at_a_time or jobs)
        self._next_memory = 0.0
        self._slots = [_Slot(self._worker(number)) for number in range(jobs)]

    def _worker(self, slot: int) -> WorkerProcess:
        return WorkerProcess(self._context, self._parts, self._shared, slot)

    @property
    def idle(self) -> int:
        """How many more tests can start now."""
        return sum(slot.job is None for slot in self._slots)

    @property
    def busy(self) -> int:
        """How many tests are running."""
        return sum(slot.job is not None and slot.job.test is not None for slot in self._slots)

    def submit(self, test: int, keep: frozenset[str], seed: int, full: bool = True, limit: float | None = None) -> None:
        """Starts a test on an idle worker. If not `full`, it ends as soon as the robot is stuck for good.

        It may take `limit` s of real time, without its preparation; None for what the scenario says.
        """
        limit = limit or self._limit
        self._start(Job(test, Run(keep, seed, full, limit), limit + self._margin))

    def _start(self, job: Job) -> int:
        """Starts a job on an idle worker, one that has prepared if possible; returns its slot."""
        idle = (number for number, slot in enumerate(self._slots) if slot.job is None)
        number = min(idle, key=lambda number: not self._slots[number].ready)
        slot = self._slots[number]
        slot.job, slot.result = job, None
        self._hand_over(number)
        return number

    def _hand_over(self, number: int) -> None:
        """Gives a worker its job, now or once it has prepared: until then it would not read it."""
        slot = self._slots[number]
        self._shared.progress[number * COLUMNS] = math.nan
        self._shared.begun[number] = 0.0 if self._prepares else time.monotonic()
        slot.clock = Stopwatch(LONGEST_LOOK)
        if slot.ready and slot.job is not None:
            slot.worker.give(slot.job.task)

    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]:
        """Tests that have ended, waiting at most `seconds` for one if one runs. Raises UserError if the world cannot be simulated.

        Has to be called often: between two calls no more than `LONGEST_LOOK` counts as time of the tests.
        """
        until = time.monotonic() + seconds
        self._look(0.0)
        while not (ended := self._ended()) and self.busy and (left := until - time.monotonic()) > 0.0:
            self._look(min(left, CLOCK_PERIOD))
        return ended

    def _ended(self) -> list[tuple[int, RunResult | Broken]]:
        """Takes the results of tests, in the order of their numbers."""
        ended = []
        for slot in self._slots:
            if slot.job is not None and slot.job.test is not None and isinstance(slot.result, RunResult | Broken):
                ended.append((slot.job.test, slot.result))
                slot.job = None
        if ended:
            for slot in self._slots:
                slot.breaks = 0
        return sorted(ended, key=lambda one: one[0])

    def _look(self, seconds: float) -> None:
        """Waits at most `seconds` for a worker to answer, to print or to die. Replaces what died, and kills what takes too long or
        too much.
        """
        owners: dict[Any, int] = {
            handle: number for number, slot in enumerate(self._slots) for handle in slot.worker.handles
        }
        for number in sorted({owners[handle] for handle in wait(owners, seconds)}):
            self._listen(number)
        for number, slot in enumerate(self._slots):
            if slot.job is not None and slot.result is None:
                self._kill_if_late(number)
        if time.monotonic() >= self._next_memory:
            self._next_memory = time.monotonic() + MEMORY_PERIOD * max(1.0, len(self._slots) / FEW)
            for number in range(len(self._slots)):
                self._kill_if_large(number)

    def _listen(self, number: int) -> None:
        slot = self._slots[number]
        try:
            answer = slot.worker.answer()
        except EOFError:
            self._lose(number, f"the simulator's process died ({slot.worker.died()})")
            return
        match answer:
            case None:
                return
            case Ready():
                slot.ready = True
                if slot.job is not None:
                    self._hand_over(number)
            case Refused(why):
                raise why
            case Broke(reason):
                slot.worker.kill()
                self._replace(number, Broken("error", reason))
            case _:
                slot.result = answer

    def _kill_if_late(self, number: int) -> None:
        slot, begun = self._slots[number], self._shared.begun[number]
        assert slot.job is not None
        if begun and slot.clock.since != begun:
            slot.clock = Stopwatch(LONGEST_LOOK, begun)
        limit, what = (slot.job.limit, "") if begun else (PREPARATION, " to prepare")
        if slot.clock.look() > limit:
            slot.worker.kill()
            self._replace(number, Broken("timeout", f"took longer than {limit:g} s of wall clock{what}"))

    def _kill_if_large(self, number: int) -> None:
        worker = self._slots[number].worker
        if worker.memory() > self._memory:
            worker.kill()
            self._lose(number, too_large(self._memory))

    def _lose(self, number: int, how: str) -> None:
        """A worker is gone. Its job is broken, unless it had not yet begun with that: then it is made by another one.

        Raises UserError if that happens again and again.
        """
        slot = self._slots[number]
        slot.breaks += not slot.ready
        if slot.breaks > MOST_BREAKS:
            raise UserError(
                f"the simulator's processes die before they run a test: {how}; is there enough memory for the world?"
            )
        self._replace(number, Broken("error", how) if slot.ready else None)

    def _replace(self, number: int, broken: Broken | None) -> None:
        """A new worker for one that is gone, whose job has the result `broken`, or is made again."""
        slot = self._slots[number]
        slot.worker, slot.ready = self._worker(number), False
        if slot.job is None or slot.result is not None:
            return
        slot.result = broken
        if broken is None:
            self._hand_over(number)

    def settle(self, elements: frozenset[str]) -> Callable[[], Start | Broken | None]:
        """Lets an idle worker settle the world, and find which of `elements` rest on which. The result returns it, or None until it
        is known.
        """
        slot = self._slots[self._start(Job(None, Settle(elements), PREPARATION))]

        def found() -> Start | Broken | None:
            self._look(0.0)
            result = slot.result
            if result is None or isinstance(result, RunResult):
                return None
            slot.job = None
            return result

        return found

    def live(self) -> list[Live]:
        """The running tests that have begun to move."""
        rows = []
        for number, slot in enumerate(self._slots):
            values = self._shared.progress[number * COLUMNS : (number + 1) * COLUMNS]
            if slot.job is not None and slot.job.test is not None and all(map(math.isfinite, values)):
                rows.append(Live(number, slot.job.test, values[0], tuple(values[1:]), self._shared.moved(number)))
        return rows

    def paces(self) -> list[Pace]:
        """How far the running tests are that have begun to move."""
        paces = []
        for number, slot in enumerate(self._slots):
            # The clock is that of the preparation until it was looked at once more.
            if slot.job is not None and slot.clock.since == self._shared.begun[number]:
                paces.append(Pace(self._shared.progress[number * COLUMNS], slot.clock.look()))
        return [pace for pace in paces if math.isfinite(pace.simulated)]

    def close(self) -> None:
        """Kills what runs."""
        for slot in self._slots:
            slot.worker.kill()
