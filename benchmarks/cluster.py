"""How much sooner a reduction ends with more workers, and how many tests that costs: the real
engine, tests that take no time.

python benchmarks/cluster.py [--models 200] [--workers 1,8,64,512]

Time is simulated: a test takes 20 to 60 s of it, its start and its way back nothing. What the
engine itself takes is real, and shown.
"""

from __future__ import annotations

import argparse
import heapq
import random
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from long_run import world_of

from ddenv.engine.__main__ import _begin
from ddenv.engine.control import Control
from ddenv.engine.driver import Driver
from ddenv.engine.journal import Journal
from ddenv.engine.scheduler import TestScheduler
from ddenv.engine.worker import Run, Start
from ddenv.robot.result import RunResult
from ddenv.robot.settled import Settled
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import read_parts, scenario_for_world

SHORTEST, LONGEST = 20.0, 60.0  # s
NEEDED = 3


def duration(keep: frozenset[str], seed: int) -> float:
    """How long a test takes, simulated s."""
    return random.Random(f"{len(keep)} {seed}").uniform(SHORTEST, LONGEST)


class Simulated:
    """Stands for a pool: the test that ends first ends, and the clock is set to that."""

    def __init__(self, workers: int, needed: frozenset[str]) -> None:
        self.workers, self.needed = workers, needed
        self.clock, self.made, self.busy_for = 0.0, 0, 0.0
        self.running: list[tuple[float, int, bool, int]] = []

    @property
    def idle(self) -> int:
        return self.workers - len(self.running)

    @property
    def busy(self) -> int:
        return len(self.running)

    def submit(self, test: int, run: Run) -> None:
        takes = duration(run.keep, run.seed)
        self.made, self.busy_for = self.made + 1, self.busy_for + takes
        heapq.heappush(self.running, (self.clock + takes, test, self.needed <= run.keep, run.seed))

    def finished(self, seconds: float) -> list[tuple[int, RunResult]]:
        if not self.running:
            return []
        self.clock, test, fails, seed = heapq.heappop(self.running)
        rows = np.zeros((2, 8))
        rows[:, 4], rows[1, :2] = 1, (1, 2 if fails else 4)
        return [
            (
                test,
                RunResult(
                    outcome="failed" if fails else "pass",
                    failure="stuck" if fails else "",
                    trajectory=rows,
                    motions={},
                    simulated_seconds=1.0,
                    wall_seconds=0.01,
                    seed=seed,
                ),
            )
        ]

    def settle(self, elements: frozenset[str]):
        return lambda: Start([], Settled())

    def live(self) -> list:
        return []


def reduce(folder: Path, models: int, workers: int) -> tuple[Simulated, float, int, int]:
    """A reduction with so many workers: its pool, the real s that it took, how many models are
    left, and how many tests no verdict rests on.
    """
    path = folder / f"{models}-{workers}.ddenv"
    world = folder / f"crates-{models}.sdf"
    world.write_text(world_of(models))
    create_run(scenario_for_world(world, (-2, -2, 0.2, 0.8), (models, models)), path)
    chosen = random.Random(1).sample(range(models), NEEDED)
    pool, began = (
        Simulated(workers, frozenset(f"crate {number}" for number in chosen)),
        time.perf_counter(),
    )
    with RunFile(path) as file:
        scenario, parsed, _ = read_parts(file)
        file.own()
        journal = Journal(file)
        _begin(journal, workers, None)
        control = Control(journal, threading.Event(), time.time())
        Driver(scenario, parsed, journal, TestScheduler(journal, pool, control), control).reduce()
        state, real = journal.state, time.perf_counter() - began
        return pool, real, len(state.environment), state.ahead


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--models", type=int, default=200)
    parser.add_argument("--workers", default="1,8,64,512")
    options = parser.parse_args()
    print(
        "| workers | tests | for nothing | simulated h | times as fast | busy | engine, ms a test |"
    )
    print("|---|---|---|---|---|---|---|")
    first = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for workers in map(int, options.workers.split(",")):
            pool, real, left, vain = reduce(Path(folder), options.models, workers)
            assert left == NEEDED, left
            first = first or pool.clock
            row = (
                f"{workers}",
                f"{pool.made}",
                f"{vain}",
                f"{pool.clock / 3600:.2f}",
                f"{first / pool.clock:.1f}",
                f"{pool.busy_for / (pool.clock * workers):.0%}",
                f"{1000 * real / pool.made:.0f}",
            )
            print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
