"""What a worker process does: build the world's template once, then run one test at a time in it."""

from __future__ import annotations

import os
import signal
import threading
import time
from typing import Any

from ddenv.errors import UserError
from ddenv.robot.result import RunResult
from ddenv.robot.template import Template
from ddenv.runfile.store import COLUMNS
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

_template: Template | UserError
_progress: Any


def prepare(scenario: Scenario, world: World, robot: Model, progress: Any) -> None:
    """Runs first in every worker. `progress` is shared memory, `COLUMNS` doubles a slot.

    What is wrong with the world is kept, and told by every test: an exception here would only break the pool.
    """
    global _template, _progress
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_follow_parent, args=(os.getppid(),), daemon=True).start()
    _progress = progress
    try:
        _template = Template(world, robot, scenario)
    except UserError as error:
        _template = error


def run_test(keep: frozenset[str], seed: int, slot: int) -> RunResult:
    """One test, with its progress in `slot` of the shared memory."""
    if isinstance(_template, UserError):
        raise _template
    start = slot * COLUMNS

    def report(time_s: float, pose: tuple[float, ...]) -> None:
        _progress[start : start + COLUMNS] = (time_s, *pose)

    return _template.run(keep, seed, report)


def _follow_parent(parent: int) -> None:
    """An engine that is killed takes its workers with it: they must not compute for nobody."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
