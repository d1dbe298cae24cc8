"""Worker processes: each runs one test at a time, and is killed and replaced when it dies or takes too long."""

from __future__ import annotations

import math
import multiprocessing
import os
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, TimeoutError, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.context import SpawnContext, SpawnProcess

from pebble import ProcessExpired, ProcessPool

from ddenv.engine import worker
from ddenv.engine.worker import REASON
from ddenv.errors import UserError
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


# How often workers may die between two finished tests before the engine gives up.
MOST_BREAKS = 3
# How much longer than its time limit a test of the user's own simulator may take, s: its worker ends the command, and says why.
MARGIN = 60.0


@dataclass(frozen=True)
class Broken:
    """A test without a result: `outcome` is "timeout" (wall clock) or "error" (its worker died or broke)."""

    outcome: str
    failure: str


@dataclass(frozen=True)
class Job:
    """A test in flight, in its worker slot."""

    test: int
    keep: frozenset[str]
    seed: int
    full: bool
    slot: int


class Pool:
    """`jobs` workers on one scenario; its `simulation.wall_timeout` bounds one test in real time."""

    def __init__(self, scenario: Scenario, world: World, robot: Model, jobs: int) -> None:
        self._jobs = jobs
        # The user's own simulator gets the environment unchanged.
        self._context = DrakeContext() if scenario.oracle is None else multiprocessing.get_context("spawn")
        progress, reasons = self._context.RawArray("d", jobs * COLUMNS), self._context.RawArray("c", jobs * REASON)
        self._shared = worker.Shared(progress, reasons)
        self._parts = (scenario, world, robot)
        self._wall_timeout = scenario.simulation.wall_timeout + (0.0 if scenario.oracle is None else MARGIN)
        self._free = list(range(jobs))
        self._running: dict[Future[RunResult], Job] = {}
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

    def submit(self, test: int, keep: frozenset[str], seed: int, full: bool = True) -> None:
        """Starts a test on an idle worker. If not `full`, it ends as soon as the robot is stuck for good."""
        job = Job(test, keep, seed, full, self._free.pop(0))
        try:
            self._schedule(job)
        except RuntimeError:
            # A worker died while idle.
            self._start_again([job])

    def _schedule(self, job: Job) -> None:
        self._shared.progress[job.slot * COLUMNS] = math.nan
        self._shared.reasons[job.slot * REASON : (job.slot + 1) * REASON] = bytes(REASON)
        work = (job.keep, job.seed, job.full, job.slot)
        self._running[self._pool.schedule(worker.run_test, args=work, timeout=self._wall_timeout)] = job

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
        """Tests that have ended, waiting at most `seconds` for one. Raises UserError if the world cannot be simulated."""
        wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)
        results = []
        try:
            for future, job in sorted(self._running.items(), key=lambda one: one[1].test):
                result = self._result(future, job)
                if result is not None:
                    del self._running[future]
                    self._free.append(job.slot)
                    self._breaks = 0
                    results.append((job.test, result))
        except BrokenProcessPool:
            self._start_again([])
        return results

    def _result(self, future: Future[RunResult], job: Job) -> RunResult | Broken | None:
        """How a test ended; None if it is still running."""
        start = job.slot * REASON
        # Its worker has ended itself. Pebble may not know that yet, or never: it misses a death that follows a start at once.
        if self._shared.reasons[start] != b"\0":
            reason = self._shared.reasons[start : start + REASON].rstrip(b"\0")
            return Broken("error", reason.decode(errors="ignore"))
        if not future.done():
            return None
        try:
            return future.result()
        except TimeoutError:
            return Broken("timeout", f"took longer than {self._wall_timeout:g} s of wall clock")
        except ProcessExpired as error:
            return Broken("error", f"the simulator's process died (exit code {error.exitcode})")

    def live(self) -> list[Live]:
        """The running tests that have begun to move."""
        rows = []
        for job in self._running.values():
            values = self._shared.progress[job.slot * COLUMNS : (job.slot + 1) * COLUMNS]
            if all(map(math.isfinite, values)):
                rows.append(Live(job.slot, job.test, values[0], tuple(values[1:])))
        return rows

    def close(self) -> None:
        """Kills what runs."""
        # pebble is only partly typed.
        self._pool.stop()  # type: ignore[no-untyped-call]
        self._pool.join()
