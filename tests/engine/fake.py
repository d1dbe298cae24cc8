"""A simulator that costs nothing: the one seam where tests stand in for Drake."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ddenv.engine.__main__ import _begin
from ddenv.engine.control import Control, DiskSpace
from ddenv.engine.driver import Driver
from ddenv.engine.journal import Journal
from ddenv.engine.scheduler import TestScheduler
from ddenv.engine.shared import Key, Place
from ddenv.engine.worker import Broken, Run, Start
from ddenv.robot.result import RunResult
from ddenv.robot.settled import Settled
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Live, RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import read_parts
from ddenv.settings import PRINTED
from ddenv.world.model import World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import read_world
from tests.conftest import DATA
from tests.wall import wall

# What every run notices, in s; the ground is no element.
SENSED = {"beam": 0.5, "wall": 0.25, "ground_plane": 0.0}
TOUCHED = {"beam": 1.5, "ground_plane": 0.0}

# A certificate that takes few runs, for tests that are not about it.
CHEAP = {"keep_rate": 0.5}

Oracle = Callable[[frozenset[str], int], str]
# What a run that may be cut shows then, or "" where it is not cut.
Cut = Callable[[frozenset[str], int], str]
# The models that can have changed a bit of a run of these models, None if nobody knows.
TookPart = Callable[[frozenset[str], int], frozenset[str] | None]
ENDS = {"similar": ("failed", 2.0), "other": ("failed", 9.0), "pass": ("pass", 4.0)}


def result(outcome: str, seed: int, x: float, cut: bool = False) -> RunResult:
    """A run of 2 s that ends at (x, 0, 0)."""
    trajectory = np.zeros((3, 8))
    trajectory[:, 0], trajectory[:, 1], trajectory[:, 4] = (0, 1, 2), (0, x / 2, x), 1
    failure = "stuck" if outcome == "failed" else ""
    return RunResult(
        outcome=outcome,
        failure=failure,
        trajectory=trajectory,
        motions={},
        simulated_seconds=2.0,
        wall_seconds=0.01,
        seed=seed,
        first_sensed=SENSED,
        first_touched=TOUCHED,
        cut=cut,
    )


class FakePool:
    """Stands for `ddenv.engine.pool.Pool`; `oracle(models, seed)` says "similar", "other", "pass"
    or "error".

    `cut(models, seed)` says "similar" or "other" of a run that is ended early unless it has to be
    full. Tests finish in an order that `seed` shuffles, as they do on a busy machine.
    """

    def __init__(self, oracle: Oracle, jobs: int, seed: int = 0, cut: Cut = lambda *_: "") -> None:
        self.oracle, self.jobs, self.random, self.cut = oracle, jobs, random.Random(seed), cut
        self.running: list[tuple[int, Run]] = []
        self.made: list[tuple[frozenset[str], int]] = []
        # What rests on what, and how often the driver asks before it is known.
        self.supports: list[tuple[str, str]] | Broken = []
        self.ties: list[tuple[str, str]] | None = None
        self.took_part: TookPart = lambda *_: None
        # When a run of these models has each of them in view, s.
        self.sensed: Callable[[frozenset[str], int], dict[str, float]] = lambda *_: SENSED
        # Where the robot is to the left of its way, m: runs that end alike may still differ.
        # The models that move by themselves wherever they are kept.
        self.moves: frozenset[str] = frozenset()
        self.aside: Callable[[frozenset[str], int], float] = lambda *_: 0.0
        # The same for the models that move by themselves.
        self.aside_of_others: Callable[[frozenset[str], int], float] = lambda *_: 0.0
        self.settling = 0
        self.settled = Settled()
        self.limits: list[float | None] = []
        # Where else than it says a run ends, m.
        self.shifted: Callable[[frozenset[str], int], float] = lambda *_: 0.0
        # How far running tests are, and how long they took so far, s.
        self.pace: list[tuple[Live, float]] = []
        # What a run with other values of numbers shows.
        self.changed: Callable[[frozenset[str], int, dict[str, float]], str] | None = None

    @property
    def idle(self) -> int:
        return self.jobs - len(self.running)

    @property
    def busy(self) -> int:
        return len(self.running)

    def submit(self, test: int, run: Run) -> None:
        assert self.idle
        self.limits.append(run.limit)
        self.running.append((test, run))

    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]:
        if not self.running:
            return []
        test, run = self.running.pop(self.random.randrange(len(self.running)))
        keep, seed, full, changes = run.keep, run.seed, run.ends is None, run.changes
        self.made.append((keep, seed))
        cut = "" if full else self.cut(keep, seed)
        shown = cut or (
            self.changed(keep, seed, dict(changes))
            if changes and self.changed
            else self.oracle(keep, seed)
        )
        if shown == "error":
            return [(test, Broken("error", "it broke"))]
        outcome, x = ENDS[shown]
        made = result(outcome, seed, x + self.shifted(keep, seed), bool(cut))
        made.trajectory[1, 2] = self.aside(keep, seed)
        motions = {name: made.trajectory.copy() for name in self.moves & keep}
        for rows in motions.values():
            rows[1, 2] += self.aside_of_others(keep, seed)
        more = {"took_part": self.took_part(keep, seed), "first_sensed": self.sensed(keep, seed)}
        return [(test, replace(made, motions=motions, **more))]

    def settle(self, elements: frozenset[str]) -> Callable[[], Start | Broken | None]:
        looks = iter([None] * self.settling)
        settled = (
            self.supports
            if isinstance(self.supports, Broken)
            else Start(self.supports, self.settled, self.ties)
        )
        return lambda: next(looks, settled)

    def live(self) -> list[tuple[Live, float]]:
        return self.pace


def new_run(
    folder: Path, *, early_stop: bool = False, world: Path = DATA / "wall.sdf", **reduction
) -> Path:
    """A run file of the small world, reduced as printed: the tests know the paper's rounds, and
    oracles a run by its seed.
    """
    usual = PRINTED | CHEAP | {"early_stop": early_stop, "seeds": "consecutive"}
    path = folder / f"run-{len(list(folder.iterdir()))}.ddenv"
    create_run(wall(world=world, reduction=usual | reduction), path)
    return path


class Engine(NamedTuple):
    """What works on a run."""

    scenario: Scenario
    world: World
    journal: Journal
    scheduler: TestScheduler
    control: Control

    @property
    def driver(self) -> Driver:
        return Driver(*self)


@contextmanager
def engine(
    path: Path,
    pool: FakePool,
    accept_mode: str | None = None,
    prepare: Callable[[RunFile], object] = lambda _: None,
    others: dict[Key, Place] | None = None,
    terminated: threading.Event | None = None,
    watch: Callable[[RunFile], DiskSpace | None] = lambda _: None,
    attended: bool = False,
) -> Iterator[Engine]:
    """An engine as the program has it, in this process."""
    with RunFile(path) as file:
        scenario, world, _ = read_parts(file)
        disk = watch(file)
        file.own(*([disk.wait] if disk else []))
        journal = Journal(file)
        _begin(journal, pool.jobs, accept_mode)
        prepare(file)
        control = Control(journal, terminated or threading.Event(), time.time(), disk, attended)
        yield Engine(
            scenario, world, journal, TestScheduler(journal, pool, control, others), control
        )


def drive(path: Path, pool: FakePool, mixed: bool = False, **options) -> RunState:
    """Works on a run to its end; `options` are those of `engine`."""
    with engine(path, pool, **options) as one:
        one.scheduler.check_repeats(mixed)
        one.driver.reduce()
        return one.journal.state


ELEMENTS = read_world(DATA / "wall.sdf").elements()
