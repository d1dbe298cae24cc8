"""Keeps the stage in step with the run file: reads events, chooses what to show, moves the robot."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable

import numpy as np

from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.position import Position
from ddenv.runfile.state import RunState
from ddenv.runfile.store import COLUMNS, ROBOT, Live, RunFile
from ddenv.runs.creation import read_parts
from ddenv.runs.wanted import Wanted, row_of
from ddenv.scene import colors
from ddenv.scene.camera import set_up, view
from ddenv.scene.draw import Scenery, circle, flag, mark
from ddenv.scene.shot import Shot, live_pose, replay_time, shot, shot_of
from ddenv.scene.stage import Stage
from ddenv.world.motion import pose_at
from ddenv.world.placement import spawn_pose
from ddenv.world.scenario import Goal, Spawn

READ_EVERY = 0.1  # time between reads of the run file, s
LOOK_FOR_ENGINE = 1.0  # time between checks for a working engine, s


class Player:
    """Shows one run on a stage. `say(name=..., title=..., models=..., time=...)` receives the caption of the picture."""

    def __init__(self, run: RunFile, stage: Stage, say: Callable[..., None]) -> None:
        self._run, self._stage, self._say = run, stage, say
        scenario, world, robot = read_parts(run)
        self._name = scenario.name
        self._position = Position(run.events)
        self._wanted = Wanted()
        self._elements = world.elements(frozenset(scenario.protected))
        self._scenery = Scenery(stage, world, robot, self._elements)
        self._start = spawn_pose(scenario.robot.spawn) @ robot.pose.inverse() @ robot.links[0].pose
        self._epsilon, self._timeout = scenario.failure.epsilon, scenario.failure.timeout
        self._shot: Shot | None = None
        self._began = self._read_at = self._looked_at = self._ran_at = -math.inf
        self._engine = False
        self._live: list[Live] = []
        self._motions: dict[str, np.ndarray] = {}
        self._trail: list[tuple[float, ...]] = []
        self._evidence: int | None = None
        self._set_scene(scenario.robot.spawn, scenario.goal)

    def _set_scene(self, spawn: Spawn, goal: Goal) -> None:
        start = (spawn.x, spawn.y, self._scenery.height(spawn.x, spawn.y))
        end = (goal.x, goal.y, self._scenery.height(goal.x, goal.y))
        set_up(self._stage, view(start, end))
        circle(self._stage, "start", start, 0.6, colors.START)
        flag(self._stage, "goal", end, goal.tolerance, colors.GOAL)
        self._scenery.place_robot(self._start)

    @property
    def _state(self) -> RunState:
        """The run at the moment that is shown."""
        return self._position.now

    def show(self, wanted: Wanted) -> None:
        """Shows another moment of the run, or another row of its table, from the next tick on."""
        self._wanted, self._read_at = wanted, -math.inf
        self._position.go(wanted.at)

    def tick(self, now: float) -> None:
        """Updates the stage to `now`, s of a monotonic clock. Raises UserError for a damaged run file."""
        if now - self._read_at >= READ_EVERY:
            self._read_at = now
            self._read(now)
        self._move(now)

    def _read(self, now: float) -> None:
        if now - self._looked_at >= LOOK_FOR_ENGINE:
            self._looked_at = now
            self._engine = engine_is_alive(self._run.path)
        # A killed engine leaves its rows behind. Read rows before events, so that their tests are known.
        self._live = self._run.live() if self._engine and self._wanted.at is None else []
        self._position.catch_up()
        row = row_of(self._state, self._wanted)
        following = shot_of(self._state, row, self._live) if row else self._usual(now)
        if any(row.test == following.test for row in self._live):
            self._ran_at = now
        if self._state.evidence_test != self._evidence:
            self._show_evidence()
        if following != self._shot:
            self._cut(following, now)

    def _usual(self, now: float) -> Shot:
        return shot(self._state, self._live, self._shot, now - self._ran_at)

    def _cut(self, following: Shot, now: float) -> None:
        before, self._shot = self._shot, following
        self._scenery.show(following)
        self._caption(following, "")
        if before is not None and (before.kind, before.test) == (following.kind, following.test):
            return
        self._began, self._motions, self._trail = now, {}, []
        if following.kind == "replay" and following.test is not None:
            self._motions = {name: _rows(samples) for name, samples in self._run.motions(following.test).items()}
        robot = self._motions.get(ROBOT)
        # The path of the evidence is drawn anyway.
        hidden = robot is None or following.test == self._state.evidence_test
        self._scenery.trail(np.zeros((0, COLUMNS)) if robot is None or hidden else robot)
        if following.kind == "start" or (following.kind == "replay" and robot is None):
            self._scenery.place_robot(self._start)

    def _move(self, now: float) -> None:
        shot = self._shot
        if shot is None or shot.kind == "start":
            return
        if shot.kind == "live":
            self._follow_live(shot)
            return
        robot = self._motions.get(ROBOT)
        if robot is None or not len(robot):
            return
        time = replay_time(now - self._began, float(robot[-1, 0]))
        self._scenery.place_robot(pose_at(robot, time))
        for name, samples in self._motions.items():
            if name != ROBOT and len(samples):
                self._scenery.place_model(name, pose_at(samples, time))
        self._caption(shot, self._clock(time))

    def _follow_live(self, shot: Shot) -> None:
        row = next((row for row in self._live if row.test == shot.test), None)
        if row is None or (self._trail and row.time <= self._trail[-1][0]):
            return
        pose = live_pose(row)
        self._scenery.place_robot(pose)
        self._trail.append((row.time, *pose.position, *pose.quaternion))
        self._scenery.trail(np.array(self._trail))
        self._caption(shot, self._clock(row.time))

    def _caption(self, shot: Shot, time: str) -> None:
        models = f"{len(shot.models)} of {len(self._elements)} models"
        self._say(name=self._name, title=shot.title, models=models, time=time)

    def _clock(self, time: float) -> str:
        return f"{time:.1f} s of {self._timeout:g} s"

    def _show_evidence(self) -> None:
        self._evidence = self._state.evidence_test
        samples = None if self._evidence is None else self._run.motion(self._evidence)
        self._scenery.evidence(None if samples is None else _rows(samples))
        if self._state.f_position is not None:
            mark(self._stage, "failure", self._state.f_position, self._epsilon, colors.FAILURE)


def _rows(samples: array[float]) -> np.ndarray:
    return np.asarray(samples, dtype=float).reshape(-1, COLUMNS)
