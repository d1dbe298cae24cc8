"""What a worker process does: prepare the simulator once, then run one test at a time in it."""

from __future__ import annotations

import os
import signal
import threading
import time
from typing import Any, Protocol

from ddenv.errors import UserError
from ddenv.robot.result import Progress, RunResult
from ddenv.runfile.store import COLUMNS
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

NICENESS = 5


class Simulator(Protocol):
    """Runs the robot in parts of one world."""

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        full: bool = True,
    ) -> RunResult: ...


_simulator: Simulator | UserError
_progress: Any


def prepare(scenario: Scenario, world: World, robot: Model, progress: Any) -> None:
    """Runs first in every worker. `progress` is shared memory, `COLUMNS` doubles a slot.

    An error in the world is stored, and raised by every test: an exception here would only break the pool.
    """
    global _simulator, _progress
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Simulations take all cores; a screen on the same machine needs little, and a user waits for it.
    os.nice(NICENESS)
    # Output printed here, also by native code, must not mix with the caller's output, which programs read.
    os.dup2(2, 1)
    threading.Thread(target=_follow_parent, args=(os.getppid(),), daemon=True).start()
    _progress = progress
    try:
        _simulator = _simulator_of(scenario, world, robot)
    except UserError as error:
        _simulator = error


def _simulator_of(scenario: Scenario, world: World, robot: Model) -> Simulator:
    if scenario.oracle is not None:
        from ddenv.robot.external.simulator import ExternalSimulator

        return ExternalSimulator(world, scenario)
    # Drake takes a second to load, and users of another simulator may not have it.
    from ddenv.robot.drake.template import Variants

    return Variants(world, robot, scenario)


def run_test(keep: frozenset[str], seed: int, full: bool, slot: int) -> RunResult:
    """One test, with its progress in `slot` of the shared memory."""
    if isinstance(_simulator, UserError):
        raise _simulator
    start = slot * COLUMNS

    def report(time_s: float, pose: tuple[float, ...]) -> None:
        _progress[start : start + COLUMNS] = (time_s, *pose)

    return _simulator.run(keep, seed, report, full)


def _follow_parent(parent: int) -> None:
    """Ends the worker when its engine is killed: nobody would use its results."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
