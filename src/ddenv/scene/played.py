"""What a browser plays by itself: the motion of finished tests, and pairs of tests to compare, as plain data for JSON."""

from __future__ import annotations

from array import array
from contextlib import suppress
from typing import Any

import numpy as np

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runfile.state import RunState
from ddenv.runfile.store import COLUMNS, RunFile
from ddenv.runs.nearest import nearest
from ddenv.runs.playback import played
from ddenv.runs.reasons import Parting, reasons
from ddenv.scene.draw import Scenery
from ddenv.scene.shot import Shot
from ddenv.world.pose import Pose, pose_of

# Digits after the point: a hundredth of a millimetre.
DIGITS = 5


def rows_of(samples: array[float]) -> np.ndarray:
    """Samples of a run file as rows (N, 8): t (s), x, y, z (m), qw, qx, qy, qz."""
    return np.asarray(samples, dtype=float).reshape(-1, COLUMNS)


def play_of(run: RunFile, position: Position, shot: Shot, scenery: Scenery) -> dict[str, Any]:
    """The finished test of `shot`: what is there, how it moves, and what the run file `lacks` of it, in sentences.

    `robot` has rows t (s), x, y, z (m), qx, qy, qz, qw; so has each of `moving`, by the browser's names, from where the model
    started. `turned` has how far left and right wheels have turned at each row of the robot, rad, as its way makes them roll.
    Raises UserError where the robot's way is missing or damaged.
    """
    one = played(run, position, shot.test or 0)
    if not one.rows:
        raise UserError(one.lacks[-1])
    moving = {
        key: [_row(row[0], scenery.moved(name, pose_of(row[1:]))) for row in rows]
        for name, rows in one.moving.items()
        if (key := scenery.key(name)) is not None
    }
    sets = {"models": shot.models, "leftOut": shot.left_out, "removed": shot.removed}
    return {
        "test": shot.test,
        "title": shot.title,
        "models": len(shot.models),
        "robot": [_row(row[0], pose_of(row[1:])) for row in one.robot],
        "wheels": scenery.wheels.data(),
        "turned": scenery.wheels.turned(one.robot).round(DIGITS).tolist(),
        "moving": moving,
        "there": {kind: [key for name in sorted(names) if (key := scenery.key(name))] for kind, names in sets.items()},
        "lacks": " ".join(one.lacks),
    }


def _row(time: float, pose: Pose) -> list[float]:
    w, x, y, z = pose.quaternion
    return [round(float(value), DIGITS) for value in (time, *pose.position, x, y, z, w)]


def pairs_of(run: RunFile, state: RunState) -> list[dict[str, Any]]:
    """Pairs of tests with the same seed that show why the robot fails, the ghost's last; empty before fresh runs show it.

    `equal` is until when they are the same, `apart` when the robots are visibly apart, both s; None if they never are.
    """
    found: list[tuple[str, Parting]] = []
    with suppress(UserError):
        found += [(f"without {each.without}", each.parting) for each in reasons(run, state) if each.parting is not None]
    near = nearest(run, state)
    if near is not None and near.parting is not None:
        found.append(("the nearest world that passes", near.parting))
    return [
        {
            "title": f"{words} (tests {one.with_test} and {one.without_test}, seed {one.seed})",
            "test": one.with_test,
            "ghost": one.without_test,
            "equal": one.equal,
            "apart": one.apart,
        }
        for words, one in found
    ]
