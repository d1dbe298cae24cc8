"""Keeps the stage in step with the run file: reads events, chooses what to show, moves the
robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from ddenv.errors import UserError
from ddenv.map.colors import HUES
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.position import Position
from ddenv.runfile.state import RunState, partition_letter
from ddenv.runfile.store import COLUMNS, Live, RunFile
from ddenv.runfile.tested import Wanted, made_for
from ddenv.runs.changes import changed_run, changes
from ddenv.runs.experiment import read_parts
from ddenv.runs.playback import played, table
from ddenv.runs.reasons import Divergence, nearest, reasons
from ddenv.scene import colors
from ddenv.scene.camera import scale_of, set_up, view
from ddenv.scene.draw import FLAG, PARTING, PIN, Scenery, mark
from ddenv.scene.shot import Shot, shot, shot_of, shot_of_test
from ddenv.scene.stage import Stage
from ddenv.scene.wheels import Wheels
from ddenv.text import Data, Names
from ddenv.world.placement import spawn_pose
from ddenv.world.pose import Pose, pose_of
from ddenv.world.sdf.numbers import changed

DIGITS = 5  # digits after the point: a hundredth of a millimetre


class Player:
    """Shows one run on a stage; a running test moves here, finished ones are played by the browser
    (`play`).

    `say(name=..., title=..., models=..., time=..., kind=..., test=..., parts=...)` receives the
    caption of the picture.
    """

    def __init__(self, run: RunFile, stage: Stage, say: Callable[..., None]) -> None:
        self._run = run
        self._stage = stage
        self._say = say
        scenario, world, robot = read_parts(run)
        self._name = scenario.name
        self._position = Position(run.events)
        self._wanted = Wanted()
        self._elements = world.elements(scenario.protected)
        wheels = Wheels(robot, scenario.robot.wheels, scenario.controller.skid)
        self._scenery = Scenery(stage, world, wheels, self._elements)
        self._start = spawn_pose(scenario.robot.spawn) @ robot.pose.inverse() @ robot.links[0].pose
        self._epsilon = scenario.failure.epsilon
        self._timeout = scenario.failure.timeout
        self._shot: Shot | None = None
        self._ran_at = -math.inf
        self._live: list[Live] = []
        self._parts: tuple[tuple[int, Names], ...] = ()
        self._letters: list[Any] = []
        self._trail: list[tuple[float, ...]] = []
        self._evidence: int | None = None
        start, end = (
            (place.x, place.y, self._scenery.height(place.x, place.y))
            for place in (scenario.robot.spawn, scenario.goal)
        )
        set_up(stage, view(start, end, self._scenery.surface))
        self._scenery.scale = scale = scale_of(start, end)
        mark(stage, "start", start, 0.6 * scale, colors.START, scale)
        mark(stage, "goal", end, scenario.goal.tolerance, colors.GOAL, scale, FLAG)
        mark(stage, PARTING[-1], (0.0, 0.0, 0.0), 0.25 * scale, colors.GHOST_TRAIL, scale, PIN)
        stage.show(PARTING, False)
        self._scenery.place_robot(self._start)

    @property
    def _state(self) -> RunState:
        """The run at the moment that is shown."""
        return self._position.now

    def show(self, wanted: Wanted) -> None:
        """Shows another moment of the run, or another row of its table, from the next tick on."""
        self._wanted = wanted
        self._position.go(wanted.at)

    def play(self, test: int) -> Data:
        """A finished test for a browser: what is there, how it moves, and what the run file `lacks`
        of it, in sentences.

        `robot` has rows t (s), x, y, z (m), qx, qy, qz, qw; so has each of `moving`, by the
        browser's names, from where the model started. `turned` has how far left and right wheels
        have turned at each row of the robot, rad, as its way makes them roll. Raises UserError
        where the robot's way is missing or damaged.
        """
        shot = self._shot_of(test)
        scenery = self._scenery
        one = played(self._run, self._position, test)
        if not one.rows:
            raise UserError(one.lacks[-1])
        moving = {
            key: [_row(row[0], scenery.moved(name, pose_of(row[1:]))) for row in rows]
            for name, rows in one.moving.items()
            if (key := scenery.movers.get(name)) is not None
        }
        return {
            "test": test,
            "title": shot.title,
            "models": len(shot.models),
            "robot": [_row(row[0], pose_of(row[1:])) for row in one.robot],
            "wheels": scenery.wheels.data(),
            "turned": scenery.wheels.turned(one.robot).round(DIGITS).tolist(),
            "moving": moving,
            "there": [key for name in sorted(shot.models) if (key := scenery.keys.get(name))],
            "gone": [
                key
                for name in sorted(shot.left_out | shot.removed)
                if (key := scenery.keys.get(name))
            ],
            "lacks": " ".join(one.lacks),
        }

    def pairs(self) -> Data:
        """What a browser may choose: how many tests there are, and pairs with the same seed that
        show why the robot fails.

        There are none before fresh runs show it. The ghost's test is the last of a pair; `equal` is
        until when they are the same, `apart` when the robots are visibly apart, both s; None if
        they never are.
        """
        found: list[tuple[str, Divergence | None]] = []
        with suppress(UserError):
            found += [
                (f"with and without {each.without}", each.parting)
                for each in reasons(self._run, self._state)
            ]
        if (near := nearest(self._run, self._state)) is not None:
            found.append(("with and the nearest world that passes", near.parting))
        with suppress(UserError):
            others = changes(self._run, self._state, None)
            found += [
                (f"now and with {each.name} = {each.value:.4g}", each.parting) for each in others
            ]
        pairs = [
            {
                "title": f"{words} ({_numbers(one)}, seed {one.seed})",
                "test": one.with_test,
                "ghost": one.without_test,
                "equal": one.equal,
                "apart": one.apart,
            }
            for words, one in found
            if one is not None
        ]
        return {"tests": len(self._state.tests), "pairs": pairs}

    def drawings(self, what: str, test: int) -> list[bytes]:
        """The messages that draw for one browser what is `still` in a finished test, or the `way`
        or `ghost-way` of its robot.

        Raises UserError.
        """
        if what == "still":
            return self._scenery.still(self._shot_of(test))
        rows = table(self._run.trajectory(test))
        # The path of the evidence is drawn anyway.
        hidden = what == "way" and test == self._evidence
        way = self._scenery.way(rows[:0] if hidden else rows, what == "ghost-way")
        if what == "ghost-way" and test < 0:
            return [way, *self._moved(test)]
        return [way]

    def _moved(self, number: int) -> list[bytes]:
        """The messages that draw where the changed model stands in a run with a changed number."""
        scenario, world, _ = read_parts(self._run)
        one, _ = changed_run(self._state, number)
        owner = one.name.rpartition(".")[0]
        if owner not in self._elements:
            return []
        after = changed(scenario, world, {one.name: one.value})[1].model(owner)
        if after == world.model(owner):
            return []
        return self._scenery.ghost_of(after)

    def _shot_of(self, test: int) -> Shot:
        """A finished test as it was made: in the environment of that moment. Raises UserError."""
        if test < 0:
            return shot_of_test(self._state, "replay", changed_run(self._state, test)[1])
        start = self._position.start_of(test)
        state = self._state
        if start is None or test > len(state.tests) or not state.test(test).is_finished:
            raise UserError(f"{self._run.path}: test {test} has not ended")
        return shot_of_test(start.after, "replay", state.test(test))

    def tick(self, now: float) -> None:
        """Updates the stage to `now`, s of a monotonic clock. Raises UserError for a damaged run
        file.
        """
        # A killed engine leaves its rows behind. Read rows before events, so that their tests are
        # known.
        if self._wanted.at is None and engine_is_alive(self._run.path):
            self._live = self._run.live()
        else:
            self._live = []
        self._position.catch_up()
        row = made_for(self._state, self._wanted)
        idle = now - self._ran_at
        if row:
            following = shot_of(self._state, row, self._live)
        else:
            following = shot(self._state, self._live, self._shot, idle)
        if any(row.test == following.test for row in self._live):
            self._ran_at = now
        if self._state.evidence_test != self._evidence:
            self._evidence = self._state.evidence_test
            samples = None if self._evidence is None else self._run.motion(self._evidence)
            self._scenery.evidence(None if samples is None else table(samples))
            if self._state.f_position is not None:
                place = self._state.f_position
                size = self._scenery.scale
                mark(self._stage, "failure", place, self._epsilon, colors.FAILURE, size, PIN)
        self._show_parts()
        if following != self._shot:
            self._cut(following)
        self._move()

    def _cut(self, following: Shot) -> None:
        before = self._shot
        self._shot = following
        self._scenery.show(following)
        self._caption(following, "")
        if before is not None and (before.kind, before.test) == (following.kind, following.test):
            return
        self._trail = []
        self._scenery.trail(np.zeros((0, COLUMNS)))
        self._scenery.place_models({})
        if following.kind != "live":
            self._scenery.place_robot(self._start)

    def _move(self) -> None:
        shot = self._shot
        if shot is None or shot.kind != "live":
            return
        row = next((row for row in self._live if row.test == shot.test), None)
        if row is None or (self._trail and row.time <= self._trail[-1][0]):
            return
        pose = pose_of(row.pose)
        self._trail.append((row.time, *pose.position, *pose.quaternion))
        trail = np.array(self._trail)
        left, right = self._scenery.wheels.turned(trail)[-1].tolist()
        self._scenery.place_robot(pose, (left, right))
        self._scenery.place_models({name: pose_of(values) for name, values in row.models.items()})
        self._scenery.trail(trail)
        self._caption(shot, f"{row.time:.1f} s of {self._timeout:g} s")

    def _caption(self, shot: Shot, time: str) -> None:
        models = f"{len(shot.models)} of {len(self._elements)} models"
        here = {
            "kind": shot.kind,
            "test": shot.test,
            "parts": self._letters,
            "limit": self._timeout,
        }
        self._say(name=self._name, title=shot.title, models=models, time=time, **here)

    def _show_parts(self) -> None:
        """Marks the partitions of the round that goes on, in the colours and with the letters of
        the map.
        """
        round = None if self._state.ended else self._state.round
        parts = () if round is None or round.done else tuple(round.split.lettered)
        if parts == self._parts:
            return
        self._parts = parts
        groups = [
            (partition_letter(number), colors.of_bytes(HUES[number % len(HUES)]), names)
            for number, names in parts
        ]
        self._letters = self._scenery.parts(groups)
        if self._shot is not None:
            self._caption(self._shot, "")


def _numbers(one: Divergence) -> str:
    if one.without_test > 0:
        return f"tests {one.with_test} and {one.without_test}"
    return f"test {one.with_test}"


def _row(time: float, pose: Pose) -> list[float]:
    w, x, y, z = pose.quaternion
    return [round(float(value), DIGITS) for value in (time, *pose.position, x, y, z, w)]
