"""What the engine itself costs: the time from a test's end to the next one's start, its own work
for each test, and its resume.

    python benchmarks/engine.py [--robot]

The real engine and its worker processes, with tests that take no time or only sleep. *Between
tests* is the time from the end of a test in a worker to the start of its next one; *own work* the
CPU time of the engine's process for each test, after its start. The times are p50 / mean / p95.
`--robot` compares two workers with one on the scenario `friction`, and two of Dask on this machine
with two plain ones, which takes minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import threading
import time
from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from long_run import ROBOT_SDF, world_of, write

from ddenv import __version__
from ddenv.engine.control import Control, Stopped
from ddenv.engine.driver import Driver
from ddenv.engine.journal import Journal
from ddenv.engine.pool import Pool
from ddenv.engine.scheduler import TestScheduler

# Loads scikit-learn, which is part of the start.
from ddenv.reduction import partitionings  # noqa: F401
from ddenv.robot.result import Ends, Progress, RunResult
from ddenv.runfile.events import EngineStarted
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.runs.experiment import read_parts, with_options
from ddenv.runs.programs import start_engine
from ddenv.world.load import SCENARIOS, load_scenario
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

NEEDED = 5
SCENARIO = """
name: crates
world: crates.sdf
robot: {model: robot.sdf, spawn: {x: -2.0, y: -2.0, z: 0.2, yaw: 0.8}}
goal: {x: 90, y: 90}
reduction: """


class Sleeper:
    """A simulator whose tests sleep for some s, and fail where all needed crates are there."""

    def __init__(
        self, log: Path, seconds: float, scenario: Scenario, world: World, robot: Model
    ) -> None:
        crates = len(world.elements())
        self._needed = {f"crate {crates * place // (NEEDED + 1)}" for place in range(1, NEEDED + 1)}
        self._seconds = seconds
        self._log = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        ends: Ends | None = None,
    ) -> RunResult:
        began = time.monotonic()
        time.sleep(self._seconds)
        failed = keep.issuperset(self._needed)
        way = np.zeros((450, 8))
        way[:, 0], way[:, 1], way[:, 4] = (
            np.arange(450) / 10,
            np.linspace(-2, 1 if failed else 9, 450),
            1,
        )
        seen = {f"crate {number}": 1.0 + number for number in range(10)}
        result = RunResult(
            outcome="failed" if failed else "pass",
            failure="stuck" if failed else "",
            trajectory=way,
            motions={},
            simulated_seconds=45.0,
            wall_seconds=self._seconds,
            seed=seed,
            first_sensed=seen,
        )
        os.write(self._log, f"{os.getpid()} {began} {time.monotonic()}\n".encode())
        return result


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--robot", action="store_true", help="one worker, two, and two of Dask, on friction"
    )
    parser.add_argument("--long", type=int, default=10_000, help="tests of the long run")
    options = parser.parse_args()
    print("| tests of | models | workers | tests | between tests, ms | own work, ms |")
    print("|---|---|---|---|---|---|", flush=True)
    printed = {"accept_rate": "first", "growth": "paper", "skip": "known"}
    for seconds, models, jobs, more in (
        (0.0, 43, 1, {}),
        (0.0, 43, 2, {}),
        (0.2, 43, 1, {}),
        (0.0, 5000, 1, {}),
        (0.0, 200, 2, printed | {"iterations": 60, "budget": options.long}),
    ):
        with tempfile.TemporaryDirectory() as folder:
            print(row(Path(folder), seconds, models, jobs, more), flush=True)
    print(
        f"\n| tests in the run | resumed after, s |\n|---|---|\n| {options.long:,} | "
        f"{resumed(options.long):.2f} |"
    )
    if options.robot:
        robot()


def robot() -> None:
    """Prints how many tests of friction are made in a minute. A LocalCluster wants the guard of
    `__main__` that this file has.
    """
    from distributed import LocalCluster

    one = speed(EngineOptions(jobs=1))
    two = speed(EngineOptions(jobs=2))
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        dask = speed(EngineOptions(jobs=2, cluster=cluster.scheduler_address))
    print("\n| friction | tests a minute | ratio |\n|---|---|---|")
    print(f"| 1 worker | {one:.1f} | |\n| 2 workers | {two:.1f} | {two / one:.2f} times one |")
    print(f"| 2 workers of Dask | {dask:.1f} | {dask / two:.2f} times two plain ones |")


def row(folder: Path, seconds: float, models: int, jobs: int, more: dict[str, object]) -> str:
    (folder / "crates.sdf").write_text(world_of(models))
    (folder / "robot.sdf").write_text(ROBOT_SDF)
    (folder / "scenario.yaml").write_text(SCENARIO + json.dumps({"baseline_runs": 4} | more))
    run, log = folder / "run.ddenv", folder / "log"
    create_run(load_scenario(folder / "scenario.yaml"), run)
    spent = work(run, jobs, partial(Sleeper, log, seconds))
    tests = sorted(tuple(map(float, line.split())) for line in log.read_text().splitlines())
    gaps = [
        1000 * (after[1] - before[2]) for before, after in pairwise(tests) if before[0] == after[0]
    ]
    between = f"{np.percentile(gaps, 50):.1f} / {np.mean(gaps):.1f} / {np.percentile(gaps, 95):.1f}"
    own = 1000 * spent / len(tests)
    return f"| {seconds:g} s | {models:,} | {jobs} | {len(tests):,} | {between} | {own:.1f} |"


def work(run: Path, jobs: int, make: partial[Sleeper]) -> float:
    """Reduces as the engine program does, in this process. Returns its own CPU time after its
    start, s.
    """
    with RunFile(run) as file:
        scenario, world, robot = read_parts(file)
        file.own()
        journal = Journal(file)
        journal.record(
            EngineStarted(pid=os.getpid(), jobs=jobs, version=__version__, simulator="none")
        )
        control, pool = (
            Control(journal, threading.Event()),
            Pool(scenario, world, robot, jobs, make),
        )
        driver = Driver(scenario, world, journal, TestScheduler(journal, pool, control), control)
        began = time.thread_time()
        with suppress(Stopped):
            driver.reduce()
        spent = time.thread_time() - began
        pool.close()
    return spent


def resumed(tests: int) -> float:
    """How long it takes until an engine knows a run of so many tests, s."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.ddenv"
        write(run, tests, 5000)
        began = time.perf_counter()
        with RunFile(run) as file:
            Journal(file)
        return time.perf_counter() - began


def speed(options: EngineOptions, tests: int = 48) -> float:
    """Tests of friction in a minute."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.ddenv"
        create_run(with_options(load_scenario(SCENARIOS / "friction.yaml"), budget=tests), run)
        start_engine(run, options).wait()
        with RunFile(run) as file:
            ended = [event.time for event in file.events() if event.kind == "test_finished"]
    # The first one of each worker also waits for the worker to start.
    return 60 * (len(ended) - options.jobs) / (ended[-1] - ended[options.jobs - 1])


if __name__ == "__main__":
    main()
