"""Worker processes: each runs one test at a time, and is killed and replaced when it dies or takes
too long.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import pickle
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from typing import Any, Protocol

from ddenv.engine.limits import GENEROUS, GIGABYTE, memory_limit
from ddenv.engine.worker import (
    AskSettled,
    Broken,
    Ended,
    Make,
    Moment,
    Ready,
    Run,
    Settle,
    Start,
    Task,
    WorkerProcess,
    simulator_of,
)
from ddenv.errors import UserError
from ddenv.robot import check_drake
from ddenv.robot.deadline import Stopwatch
from ddenv.robot.result import RunResult
from ddenv.runfile.store import Live
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

# A simulated step makes a thousand small allocations: with more of them cached by glibc, a step
# takes 59 us, not 75.
# And a worker has one core: libraries that use threads would only slow down other workers.
FOR_DRAKE = {
    "GLIBC_TUNABLES": "glibc.malloc.tcache_count=127",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}

_one_at_a_time = threading.Lock()


@contextmanager
def added_to_environment(more: Mapping[str, str]) -> Iterator[None]:
    """Adds `more` to the environment for a moment, unless the user has set it: new processes read
    it before any Python code.
    """
    with _one_at_a_time:
        added = [name for name in more if name not in os.environ]
        os.environ.update({name: more[name] for name in added})
        try:
            yield
        finally:
            for name in added:
                del os.environ[name]


# How often a worker may die before it takes its first task, while no test ends, before the engine
# gives up.
MOST_BREAKS = 3
# How much longer than its time limit a test by a command of the user's may take, s: its worker ends
# the command, and says why.
MARGIN = 60.0
# The maximum time of what comes before a test moves, s: large piles are rehearsed for minutes, but
# nothing may hang forever.
PREPARATION = 3600.0
# The maximum time between two looks that counts, s: it is longer where the engine was stopped.
LONGEST_LOOK = 1.0
# How often the memory of up to `FEW` workers is looked at, s, and that of more workers as much more
# rarely: a look takes a third of a millisecond. In this time a process fills 0.4 GB.
MEMORY_PERIOD = 0.2
FEW = 8
# The maximum time between two looks at the clocks, s.
CLOCK_PERIOD = 0.1


@dataclass(frozen=True)
class Job:
    """A task in flight, for `test` if it is one. It may take `limit` s of real time, without its
    preparation.
    """

    test: int | None
    task: Task
    limit: float


class Workers(Protocol):
    """Make tests, several at a time: processes here, or a cluster. `Pool` says what each of these
    does.
    """

    @property
    def idle(self) -> int: ...
    @property
    def busy(self) -> int: ...
    def submit(self, test: int, run: Run) -> None: ...
    def finished(self, seconds: float) -> list[Ended]: ...
    def settle(self, elements: frozenset[str]) -> AskSettled: ...
    def live(self) -> list[tuple[Live, float]]: ...
    def close(self) -> None: ...


class _Slot:
    """A place for one worker, and what is known of it: whether it has prepared, its job, and how
    often it died before that.
    """

    def __init__(self, worker: WorkerProcess) -> None:
        self.worker = worker
        self.ready = False
        self.job: Job | None = None
        self.breaks = 0
        # Where its test is, once it has begun.
        self.moment: Moment | None = None
        self.result: RunResult | Start | Broken | None = None
        self.wait(False)

    def wait(self, begun: bool) -> None:
        """A job is there that has `begun`, or is in preparation until its first moment."""
        self.moment = None
        self.begun = begun
        self.clock = Stopwatch(LONGEST_LOOK)

    def go_on(self, moment: Moment) -> None:
        """The job has come so far. What came before it began to move does not count."""
        self.moment = moment
        if self.clock.since != moment.begun:
            self.begun = True
            self.clock = Stopwatch(LONGEST_LOOK, moment.begun)


class Pool:
    """`jobs` workers on one scenario, each with a pipe of its own: whoever waits for a test is
    woken up as it ends.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        robot: Model,
        jobs: int,
        make: Make = simulator_of,
        at_a_time: int = 0,
    ) -> None:
        """`make` makes the simulator in each worker. `at_a_time` tests share the machine's memory,
        `jobs` if not given. Raises UserError where Drake is needed and not installed.
        """
        self._context = multiprocessing.get_context("spawn")
        # The user's own simulator gets the environment unchanged.
        self._variables = FOR_DRAKE if scenario.oracle is None else {}
        if scenario.oracle is None:
            check_drake()
        parts = pickle.dumps((make, (scenario, world, robot)))
        self._parts: Any = self._context.RawArray("c", len(parts))
        self._parts.raw = parts
        # A command has nothing to prepare, and its worker ends it.
        is_command = scenario.oracle is not None and scenario.oracle.command is not None
        self._prepares = not is_command
        self._limit = scenario.simulation.wall_timeout or GENEROUS
        self._margin = MARGIN if is_command else 0.0
        self._memory = memory_limit(scenario, at_a_time or jobs)
        self._next_memory = 0.0
        self._slots = [_Slot(self._worker()) for _ in range(jobs)]

    def _worker(self) -> WorkerProcess:
        with added_to_environment(self._variables):
            return WorkerProcess(self._context, self._parts)

    @property
    def idle(self) -> int:
        """How many more tests can start now."""
        return sum(slot.job is None for slot in self._slots)

    @property
    def busy(self) -> int:
        """How many tests are running."""
        return sum(slot.job is not None and slot.job.test is not None for slot in self._slots)

    def submit(self, test: int, run: Run) -> None:
        """Starts a test on an idle worker."""
        limit = run.limit or self._limit
        self._start(Job(test, replace(run, limit=limit), limit + self._margin))

    def _start(self, job: Job) -> _Slot:
        slot = min(
            (slot for slot in self._slots if slot.job is None), key=lambda slot: not slot.ready
        )
        slot.job = job
        slot.result = None
        self._hand_over(slot)
        return slot

    def _hand_over(self, slot: _Slot) -> None:
        """Gives a worker its job, now or once it has prepared: until then it would not read it."""
        slot.wait(begun=not self._prepares)
        if slot.ready and slot.job is not None:
            slot.worker.give(slot.job.task)

    def finished(self, seconds: float) -> list[Ended]:
        """Tests that have ended, waiting at most `seconds` for one if one runs. Raises UserError if
        the world cannot be simulated.

        Between two calls no more than `LONGEST_LOOK` counts as time of the tests.
        """
        until = time.monotonic() + seconds
        self._look(0.0)
        while (
            not (ended := self._ended()) and self.busy and (left := until - time.monotonic()) > 0.0
        ):
            self._look(min(left, CLOCK_PERIOD))
        return ended

    def _ended(self) -> list[Ended]:
        ended = []
        for slot in self._slots:
            if (
                slot.job is not None
                and slot.job.test is not None
                and isinstance(slot.result, RunResult | Broken)
            ):
                ended.append((slot.job.test, slot.result))
                slot.job = None
        if ended:
            for slot in self._slots:
                slot.breaks = 0
        return sorted(ended, key=lambda one: one[0])

    def _look(self, seconds: float) -> None:
        """Waits at most `seconds` for an answer, output or a death. Replaces what died, kills what
        takes too long or too much.
        """
        heard = set(
            wait([handle for slot in self._slots for handle in slot.worker.handles], seconds)
        )
        for slot in self._slots:
            if not heard.isdisjoint(slot.worker.handles):
                self._listen(slot)
            if slot.job is not None and slot.result is None:
                limit, what = (slot.job.limit, "") if slot.begun else (PREPARATION, " to prepare")
                if slot.clock.look() > limit:
                    slot.worker.kill()
                    self._replace(
                        slot, Broken("timeout", f"took longer than {limit:g} s of wall clock{what}")
                    )
        if time.monotonic() >= self._next_memory:
            self._next_memory = time.monotonic() + MEMORY_PERIOD * max(1.0, len(self._slots) / FEW)
            for slot in self._slots:
                if slot.worker.memory() > self._memory:
                    slot.worker.kill()
                    most = f"{self._memory / GIGABYTE:.3g} GB of memory"
                    self._lose(
                        slot,
                        (
                            f"used more than {most} (simulation.memory_limit, or fewer --jobs, "
                            "allows more)"
                        ),
                    )

    def _listen(self, slot: _Slot) -> None:
        try:
            while isinstance(answer := slot.worker.answer(), Moment):
                slot.go_on(answer)
        except EOFError:
            self._lose(slot, f"the simulator's process died ({slot.worker.died()})")
            return
        match answer:
            case None:
                return
            case Ready():
                slot.ready = True
                if slot.job is not None:
                    self._hand_over(slot)
            case UserError():
                raise answer
            case Broken():
                slot.worker.kill()
                self._replace(slot, answer)
            case _:
                slot.result = answer

    def _lose(self, slot: _Slot, how: str) -> None:
        """A worker is gone. Its job is broken, or made by another one if it had not yet begun.
        Raises UserError if that goes on and on.
        """
        slot.breaks += not slot.ready
        if slot.breaks > MOST_BREAKS:
            what = "the simulator's processes die before they run a test"
            raise UserError(f"{what}: {how}; is there enough memory for the world?")
        self._replace(slot, Broken("error", how) if slot.ready else None)

    def _replace(self, slot: _Slot, broken: Broken | None) -> None:
        """A new worker for one that is gone, whose job has the result `broken`, or is made
        again.
        """
        slot.worker = self._worker()
        slot.ready = False
        if slot.job is None or slot.result is not None:
            return
        slot.result = broken
        if broken is None:
            self._hand_over(slot)

    def settle(self, elements: frozenset[str]) -> AskSettled:
        """Lets an idle worker find which of `elements` rest on which. The result returns it, or
        None until it is known.
        """
        slot = self._start(Job(None, Settle(elements), PREPARATION))

        def found() -> Start | Broken | None:
            self._look(0.0)
            result = slot.result
            if result is None or isinstance(result, RunResult):
                return None
            slot.job = None
            return result

        return found

    def live(self) -> list[tuple[Live, float]]:
        """The running tests that have begun to move, and how long each took so far, s of real
        time.
        """
        running = [
            (number, slot, slot.job.test, slot.moment)
            for number, slot in enumerate(self._slots)
            if slot.job
        ]
        return [
            (
                Live(slot=number, test=test, time=now.time, pose=now.pose, models=now.models),
                slot.clock.look(),
            )
            for number, slot, test, now in running
            if test is not None
            and now is not None
            and all(map(math.isfinite, (now.time, *now.pose)))
        ]

    def close(self) -> None:
        """Kills what runs."""
        for slot in self._slots:
            slot.worker.kill()
