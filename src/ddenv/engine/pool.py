"""Worker processes: each runs one test at a time, and is killed and replaced when it dies or takes too long."""

from __future__ import annotations

import math
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from ddenv.engine import worker
from ddenv.engine.wall_limit import GENEROUS
from ddenv.engine.worker import REASON, Start
from ddenv.errors import UserError
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

Result = TypeVar("Result")

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


# How often workers may die between two finished tests before the engine gives up.
MOST_BREAKS = 3
# How much longer than its time limit a test of the user's own simulator may take, s: its worker ends the command, and says why.
MARGIN = 60.0
# The maximum time of what comes before a test moves, s: large piles are rehearsed for minutes, but nothing may hang forever.
PREPARATION = 3600.0
# The maximum time between two looks that counts, s: it is longer where the engine was stopped.
LONGEST_LOOK = 1.0


@dataclass(frozen=True)
class Broken:
    """A test without a result: `outcome` is "timeout" (wall clock) or "error" (its worker died or broke)."""

    outcome: str
    failure: str


@dataclass(frozen=True)
class Job:
    """A test in flight, in its worker slot. It may take `limit` s of real time, without its preparation."""

    test: int
    keep: frozenset[str]
    seed: int
    full: bool
    limit: float
    slot: int


@dataclass(frozen=True)
class Pace:
    """How far a running test is: `simulated` s in `real` s of wall clock."""

    simulated: float
    real: float


class Pool:
    """`jobs` workers on one scenario."""

    def __init__(self, scenario: Scenario, world: World, robot: Model, jobs: int) -> None:
        self._jobs = jobs
        # The user's own simulator gets the environment unchanged.
        self._context = DrakeContext() if scenario.oracle is None else multiprocessing.get_context("spawn")
        sizes = (("d", jobs * COLUMNS), ("d", jobs), ("c", jobs * REASON))
        self._shared = worker.Shared(*(self._context.RawArray(kind, size) for kind, size in sizes))
        self._parts = (scenario, world, robot)
        # A simulator of the user's own has nothing to prepare.
        self._prepares = scenario.oracle is None
        self._limit = scenario.simulation.wall_timeout or GENEROUS
        self._margin = 0.0 if scenario.oracle is None else MARGIN
        self._free = list(range(jobs))
        self._running: dict[Future[RunResult], Job] = {}
        # How long the test in each slot has run, or is in preparation.
        self._clocks: dict[int, Stopwatch] = {}
        self._breaks = 0
        self._pool = self._workers()

    def _workers(self) -> ProcessPool:
        return ProcessPool(
            max_workers=self._jobs,
            context=self._context,
            initializer=worker.prepare,
            initargs=(*self._parts, self._shared),
        )

    @property
    def idle(self) -> int:
        """How many more tests can start now."""
        return len(self._free)

    @property
    def busy(self) -> int:
        return len(self._running)

    def submit(self, test: int, keep: frozenset[str], seed: int, full: bool = True, limit: float | None = None) -> None:
        """Starts a test on an idle worker. If not `full`, it ends as soon as the robot is stuck for good.

        It may take `limit` s of real time, without its preparation; None for what the scenario says.
        """
        job = Job(test, keep, seed, full, limit or self._limit, self._free.pop(0))
        try:
            self._schedule(job)
        except RuntimeError:
            # A worker died while idle.
            self._start_again([job])

    def _clear(self, slot: int) -> None:
        """Makes a slot ready for new work."""
        self._shared.progress[slot * COLUMNS] = math.nan
        self._shared.reasons[slot * REASON : (slot + 1) * REASON] = bytes(REASON)
        self._shared.begun[slot] = 0.0 if self._prepares else time.monotonic()
        self._clocks[slot] = Stopwatch(LONGEST_LOOK)

    def _schedule(self, job: Job) -> None:
        self._clear(job.slot)
        work = (job.keep, job.seed, job.full, job.limit, job.slot)
        self._running[self._pool.schedule(worker.run_test, args=work)] = job

    def _start_again(self, jobs: list[Job]) -> None:
        """New workers for the tests in flight. Raises UserError if they die again and again before they finish a test."""
        self._breaks += 1
        if self._breaks > MOST_BREAKS:
            raise UserError(
                "the simulator's processes die before they run a test: is there enough memory for the world?"
            )
        self.close()
        self._pool = self._workers()
        jobs = [*self._running.values(), *jobs]
        self._running.clear()
        for job in jobs:
            self._schedule(job)

    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]:
        """Tests that have ended, waiting at most `seconds` for one. Raises UserError if the world cannot be simulated.

        Has to be called often: between two calls no more than `LONGEST_LOOK` counts as time of the tests.
        """
        wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)
        results = []
        try:
            for future, job in sorted(self._running.items(), key=lambda one: one[1].test):
                result = self._result(future, job.slot, job.limit)
                if result is not None:
                    del self._running[future]
                    self._free.append(job.slot)
                    self._breaks = 0
                    results.append((job.test, result))
        except BrokenProcessPool:
            self._start_again([])
        return results

    def _result(self, future: Future[Result], slot: int, limit: float) -> Result | Broken | None:
        """How the work in a slot ended; None if it is still running. Kills a test that takes longer than `limit` s."""
        start = slot * REASON
        # Its worker has ended itself. Pebble may not know that yet, or never: it misses a death that follows a start at once.
        if self._shared.reasons[start] != b"\0":
            reason = self._shared.reasons[start : start + REASON].rstrip(b"\0")
            return Broken("error", reason.decode(errors="ignore"))
        if not future.done():
            return self._late(future, slot, limit)
        try:
            return future.result()
        except ProcessExpired as error:
            return Broken("error", f"the simulator's process died (exit code {error.exitcode})")

    def _late(self, future: Future[Result], slot: int, limit: float) -> Broken | None:
        """Kills what takes too long."""
        begun = self._shared.begun[slot]
        if begun and self._clocks[slot].since != begun:
            self._clocks[slot] = Stopwatch(LONGEST_LOOK, begun)
        limit, what = (limit + self._margin, "") if begun else (PREPARATION, " to prepare")
        # Pebble's threads do not survive that a test is cancelled before its worker has it.
        if self._clocks[slot].look() <= limit or not future.running() or not future.cancel():
            return None
        return Broken("timeout", f"took longer than {limit:g} s of wall clock{what}")

    def settle(self, elements: frozenset[str]) -> Callable[[], Start | Broken | None]:
        """Lets an idle worker settle the world, and find which of `elements` rest on which. The result returns it, or None until it
        is known.
        """
        slot = self._free.pop(0)
        self._clear(slot)
        future: Future[Start] = self._pool.schedule(worker.settle, args=(elements, slot))

        def found() -> Start | Broken | None:
            result: Start | Broken | None
            try:
                result = self._result(future, slot, PREPARATION)
            except BrokenProcessPool:
                result = Broken("error", "the simulator's process died")
            if result is not None:
                self._free.append(slot)
            return result

        return found

    def live(self) -> list[Live]:
        """The running tests that have begun to move."""
        rows = []
        for job in self._running.values():
            values = self._shared.progress[job.slot * COLUMNS : (job.slot + 1) * COLUMNS]
            if all(map(math.isfinite, values)):
                rows.append(Live(job.slot, job.test, values[0], tuple(values[1:])))
        return rows

    def paces(self) -> list[Pace]:
        """How far the running tests are that have begun to move."""
        clocks, shared = self._clocks, self._shared
        # The clock is that of the preparation until it was looked at once more.
        slots = [job.slot for job in self._running.values() if clocks[job.slot].since == shared.begun[job.slot]]
        paces = [Pace(shared.progress[slot * COLUMNS], clocks[slot].look()) for slot in slots]
        return [pace for pace in paces if math.isfinite(pace.simulated)]

    def close(self) -> None:
        """Kills what runs."""
        # pebble is only partly typed.
        self._pool.stop()  # type: ignore[no-untyped-call]
        self._pool.join()
