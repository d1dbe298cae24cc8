"""Worker processes: each runs one test at a time, and is killed and replaced when it dies or takes too long."""

from __future__ import annotations

import math
import multiprocessing
from concurrent.futures import FIRST_COMPLETED, Future, TimeoutError, wait
from dataclasses import dataclass

from pebble import ProcessExpired, ProcessPool

from ddenv.engine import worker
from ddenv.robot.result import RunResult
from ddenv.runfile.store import COLUMNS, Live
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario


@dataclass(frozen=True)
class Broken:
    """A test without a result: `outcome` is "timeout" (wall clock) or "error" (the process died)."""

    outcome: str
    failure: str


class Pool:
    """`jobs` workers on one scenario; its `simulation.wall_timeout` bounds one test in real time."""

    def __init__(self, scenario: Scenario, world: World, robot: Model, jobs: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._progress = context.RawArray("d", jobs * COLUMNS)
        self._pool = ProcessPool(
            max_workers=jobs,
            context=context,
            initializer=worker.prepare,
            initargs=(scenario, world, robot, self._progress),
        )
        self._wall_timeout = scenario.simulation.wall_timeout
        self._free = list(range(jobs))
        self._running: dict[Future, tuple[int, int]] = {}

    @property
    def idle(self) -> int:
        """How many more tests can start now."""
        return len(self._free)

    @property
    def busy(self) -> int:
        return len(self._running)

    def submit(self, test: int, keep: frozenset[str], seed: int) -> None:
        """Starts a test on an idle worker."""
        slot = self._free.pop(0)
        self._progress[slot * COLUMNS] = math.nan
        future = self._pool.schedule(worker.run_test, args=(keep, seed, slot), timeout=self._wall_timeout)
        self._running[future] = (test, slot)

    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]:
        """Tests that have ended, waiting at most `seconds` for one. Raises UserError if the world cannot be simulated."""
        done, _ = wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)
        results = []
        for future in sorted(done, key=lambda one: self._running[one]):
            test, slot = self._running.pop(future)
            self._free.append(slot)
            results.append((test, self._result(future)))
        return results

    def _result(self, future: Future) -> RunResult | Broken:
        try:
            return future.result()
        except TimeoutError:
            return Broken("timeout", f"took longer than {self._wall_timeout:g} s of wall clock")
        except ProcessExpired as error:
            return Broken("error", f"the simulator's process died (exit code {error.exitcode})")

    def live(self) -> list[Live]:
        """The running tests that have begun to move."""
        rows = []
        for test, slot in self._running.values():
            values = self._progress[slot * COLUMNS : (slot + 1) * COLUMNS]
            if all(map(math.isfinite, values)):
                rows.append(Live(slot, test, values[0], tuple(values[1:])))
        return rows

    def close(self) -> None:
        """Kills what runs."""
        self._pool.stop()
        self._pool.join()
