"""A simulator in Python: a class of the user's, imported once by a worker, which runs one test
after the other.

Whatever it does wrong breaks the test, with the reason; the worker is replaced, since nobody knows
what is left of the object.
"""

from __future__ import annotations

import math
import os
import random
import time
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ddenv.robot.controllers import SEEDS, Answer, guarded, load
from ddenv.robot.deadline import call_within
from ddenv.robot.external.process import running
from ddenv.robot.external.protocol import Ended, Row, SimulatorSetup, SubWorld
from ddenv.robot.external.simulator import (
    EXPECTED,
    BadLog,
    PoseLog,
    scenario_in,
    temporary_folder,
    write_files,
)
from ddenv.robot.oracle import kind_of
from ddenv.robot.result import Ends, PoseRow, Progress, RunResult, has_moved
from ddenv.schemas import nearest
from ddenv.text import plain
from ddenv.world.command import start_folder
from ddenv.world.model import World, jointed_links
from ddenv.world.placement import spawn_pose
from ddenv.world.scenario import Scenario
from ddenv.world.whole import whole_of
from ddenv.world.write import without

KEY = "oracle.use"
METHOD = "run(world, seed, timeout)"
# The maximum time that the class may take to make an object, real s.
LONGEST_START = 600.0
ROW = "(time, pose) or (time, pose, poses by model)"
SHOWN = 80


class PythonSimulator:
    """Runs a class of the user's as `Plant` runs Drake. docs/any-simulator.md says what the
    class has to do.
    """

    def __init__(self, world: World, scenario: Scenario) -> None:
        """Raises UserError if there is no such class, or if it makes no object."""
        assert scenario.oracle is not None and scenario.oracle.use is not None
        self._world = world
        self._scenario = scenario
        self._removable = frozenset(world.elements(scenario.protected))
        self._names = frozenset(world.names)
        self._folder = start_folder(scenario).resolve()
        make = load(scenario.oracle.use, self._folder, KEY, METHOD)
        self._name = scenario.oracle.use.partition(":")[2]
        with ExitStack() as opened:
            # A supervisor without a command removes the files, even if this process is killed.
            temporary = opened.enter_context(temporary_folder())
            opened.enter_context(running(["-"], Path("/"), os.environ, temporary))
            self._path = temporary / scenario.world.name
            self._its_scenario = temporary / f"{scenario.world.name}.scenario.yaml"
            whole = whole_of(world, scenario)
            write_files(temporary, {self._its_scenario: scenario_in(scenario, whole, self._path)})
            setup = SimulatorSetup(
                scenario=scenario.model_dump(mode="json"),
                world=scenario.world,
                robot=scenario.robot.model,
                folder=self._folder,
                model_path=(scenario.world.parent, *scenario.reading.model_path),
            )
            self._simulator = self._guarded(
                "__init__", lambda: call_within(LONGEST_START, make, setup)
            )
            self._open = opened.pop_all()

    def close(self) -> None:
        """Removes the files of its tests. They are also removed when this process ends, however it
        does.
        """
        self._open.close()

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        ends: Ends | None = None,
    ) -> RunResult:
        """As `Simulator.run`; `ends` has no effect. Raises UserError for whatever the user's class
        does wrong.
        """
        if unknown := keep - self._names:
            raise ValueError(f"no such model: {min(unknown)}")
        started = time.perf_counter()
        removed = self._removable - keep
        # A new file: to shorten an old one takes some file systems milliseconds.
        self._path.unlink(missing_ok=True)
        write_files(self._path.parent, {self._path: without(self._world, removed)})
        models = tuple(model.name for model in self._world.models if model.name not in removed)
        world = SubWorld(self._path, self._its_scenario, models)
        links = [
            link
            for model in self._world.models
            if model.name in models
            for link in jointed_links(model)
        ]
        poses = Poses(models, progress, links)
        if progress is not None:
            # The time of a test begins here, whatever came before it.
            start = spawn_pose(self._scenario.robot.spawn)
            progress(0.0, (*start.position, *start.quaternion), {})
        random.seed(seed)
        np.random.seed(seed % SEEDS)
        ended, took_part = self._guarded("run", lambda: self._ended(world, seed, poses))
        trajectory = poses.robot.rows()
        return RunResult(
            outcome="pass" if ended.reached else "failed",
            failure="" if ended.reached else kind_of(trajectory, fell=False, arrived=None),
            trajectory=trajectory,
            motions=poses.motions(),
            simulated_seconds=float(trajectory[-1, 0]),
            wall_seconds=time.perf_counter() - started,
            seed=seed,
            took_part=took_part,
        )

    def _ended(
        self, world: SubWorld, seed: int, poses: Poses
    ) -> tuple[Ended, frozenset[str] | None]:
        """Makes a test, and adds what it yields and returns to `poses`. Raises BadLog for
        nonsense.
        """
        answer = self._simulator.run(world, seed, self._scenario.failure.timeout)
        if isinstance(answer, Generator):
            rows = answer
            try:
                while True:
                    poses.add(next(rows))
            except StopIteration as stop:
                answer = stop.value
        if not isinstance(answer, Ended) or not isinstance(answer.reached, bool | np.bool_):
            raise BadLog(
                f"returned {_shown(answer)}; expected ddenv.Ended(reached), with True or False"
            )
        for row in answer.poses:
            poses.add(row)
        if not len(poses.robot.rows()):
            raise BadLog(f"gave no poses; expected at least one row: {ROW}")
        took_part = None if answer.took_part is None else frozenset(answer.took_part)
        for name in took_part or ():
            poses.check(name, "gave took_part")
        return answer, took_part

    def _guarded(self, what: str, call: Callable[[], Answer]) -> Answer:
        """Returns `call()`. Raises UserError, in one line, for whatever that raises."""
        return guarded(
            f"simulator {self._name}: {what}", call, self._folder, f"{LONGEST_START:g} s"
        )


class Poses:
    """The poses of one test: those of the robot, and those of models and of `links` by name, each
    at most every 0.1 s.

    `progress` gets them.
    """

    def __init__(
        self, models: Iterable[str], progress: Progress | None, links: Iterable[str] = ()
    ) -> None:
        self.robot = PoseLog()
        self._models = tuple(models)
        self._links = frozenset(links)
        self._progress = progress
        self._logs: dict[str, PoseLog] = {}
        self._now: dict[str, PoseRow] = {}
        self._count = 0

    def add(self, row: Row) -> None:
        """Adds a row. Raises BadLog."""
        self._count += 1
        where = f"gave row {self._count}"
        is_row = isinstance(row, tuple | list) and (
            len(row) == 2 or (len(row) == 3 and isinstance(row[2], Mapping))
        )
        if not is_row:
            raise BadLog(f"{where}: expected {ROW}, found {_shown(row)}")
        t = row[0]
        pose = row[1]
        others = row[2] if len(row) == 3 else {}
        kept = self.robot.take(_numbers(t, pose, where), where)
        for name, its_pose in others.items():
            if name not in self._links:
                self.check(name, where)
            its_row = self._logs.setdefault(name, PoseLog()).take(
                _numbers(t, its_pose, where), where
            )
            if its_row is not None:
                self._now[name] = its_row[1:]
        if kept is not None and self._progress is not None:
            self._progress(kept[0], kept[1:], dict(self._now))

    def check(self, name: Any, where: str) -> None:
        """Raises BadLog if this is not the name of a model of the test's world."""
        if name not in self._models:
            shown = str(name)[:SHOWN]
            raise BadLog(
                f"{where}: there is no model '{shown}' in this test's "
                f"world{nearest(shown, self._models)}"
            )

    def motions(self) -> dict[str, np.ndarray]:
        """The rows (N, 8) of each model that moved, as in `RunResult`."""
        rows = {name: log.rows() for name, log in self._logs.items()}
        return {name: each for name, each in rows.items() if has_moved(each)}


def _numbers(t: Any, pose: Any, where: str) -> list[float]:
    """Time and pose as eight finite numbers. Raises BadLog."""
    try:
        numbers = [float(t), *map(float, pose)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 8 or not all(map(math.isfinite, numbers)):
        raise BadLog(f"{where}: {EXPECTED}, found {_shown((t, pose))}")
    return numbers


def _shown(value: Any) -> str:
    return plain(repr(value))[:SHOWN]
