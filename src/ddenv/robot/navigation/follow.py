"""How the robot follows a path: it aims at a place ahead on it, and only goes where its footprint hits nothing."""

from __future__ import annotations

import math

import numpy as np

from ddenv.robot.navigation.footprint import Footprint
from ddenv.robot.navigation.path import Path
from ddenv.robot.protocol import STOP, Setup, Twist
from ddenv.robot.sensing.estimate import Estimate, wrap

# Parts of the look-ahead at which the robot aims, the first whose arc is free.
PARTS = (1.0, 0.6)
# It can stop like this, m/s^2.
BRAKE = 1.0
# Standing, it aims at this part of the look-ahead: the slower, the closer it keeps to its path.
NEAREST = 0.4
# It turns on the spot when the path leads farther aside than this, until it is within the second, rad.
ASIDE = 0.9
ALONG = 0.25
# Turned along its path to this (rad) and still not free, it stays.
ALIGNED = 0.04
# Slower turns than this (rad/s) are lost between the wheels and the ground.
LEAST_TURN = 0.2
BACK_SPEED = 0.25  # m/s
# How much nearer (m) something within its margin may come in a step.
GIVE = 0.001
# With this much room (m) at its sides it goes at full speed, with none at this part of it.
ROOM = 0.35
SLOWEST = 0.25
# With this much (m) it need not look at every step.
CALM = 0.1
# Places along an arc that are tested, as parts of it, and angles of a turn (rad).
PLACES = np.linspace(0.0, 1.0, 7)
TURNS = np.array([0.0, 0.1, 0.2, 0.35])
BACK = np.array([0.0, -0.1, -0.2])  # m


class Follower:
    """Pure pursuit of `path` within the limits of `setup`. `stuck` tells that the last step found nowhere to go."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._gain = setup.settings.heading_gain
        self._look_ahead = setup.settings.planner.look_ahead
        self._body = Footprint.of(setup)
        # Faster, it could not stop within what it knows to be free.
        self._fastest = min(setup.speed, math.sqrt(2 * BRAKE * self._look_ahead))
        self._turning = False
        self._path: Path | None = None
        self._room: float | None = None
        self.reach = self._body.circumscribed + self._look_ahead + ROOM + self._body.margin
        self.stuck = False

    def step(self, path: Path, estimate: Estimate, points: np.ndarray) -> Twist:
        """Where to go next on `path`, with `points` (N, 2) m near the robot, in the frame of the estimates."""
        if path is not self._path:
            self._path, self._room = path, None
        path.locate(estimate.x, estimate.y)
        self.stuck = False
        distance, bearing = self._aim(path, estimate, PARTS[0])
        self._turning = abs(bearing) > (ALONG if self._turning else ASIDE)
        if self._turning:
            self._room = None
            return self._turn(bearing, to_robot(points, estimate))
        if self._room is not None:
            # What was free, with room, a period ago over the whole look-ahead is tested again in the next.
            room, self._room = self._room, None
            return self._drive(path, distance, bearing, room)
        points = to_robot(points, estimate)
        for part in PARTS:
            distance, bearing = self._aim(path, estimate, part)
            room = self._room_on_arc(distance, bearing, points)
            if room is not None:
                self._room = room if part == PARTS[0] and room >= CALM else None
                return self._drive(path, distance, bearing, room)
        return self._turn(bearing, points)

    def _aim(self, path: Path, estimate: Estimate, part: float) -> tuple[float, float]:
        """How far away (m) and in which direction (rad, from straight ahead) the place is that the robot aims at."""
        share = NEAREST + (1 - NEAREST) * min(max(estimate.speed / self._fastest, 0.0), 1.0)
        x, y = path.ahead(part * share * self._look_ahead)
        dx, dy = x - estimate.x, y - estimate.y
        return math.hypot(dx, dy), wrap(math.atan2(dy, dx) - estimate.heading)

    def _room_on_arc(self, distance: float, bearing: float, points: np.ndarray) -> float | None:
        """How far (m) from all `points` the robot stays on its arc to the place that it aims at; None if it touches one."""
        if abs(bearing) > ASIDE:
            return None
        if not len(points):
            return ROOM
        way = PLACES * distance
        if abs(bearing) < 1e-3:
            poses = np.stack([way, np.zeros_like(way), np.zeros_like(way)])
        else:
            headings = PLACES * (2 * bearing)
            radius = distance / (2 * math.sin(bearing))
            poses = np.stack([radius * np.sin(headings), radius * (1 - np.cos(headings)), headings])
        return room(self._body, points, poses)

    def _drive(self, path: Path, distance: float, bearing: float, room: float) -> Twist:
        bend = 2 * math.sin(bearing) / max(distance, 1e-6)
        arc = distance * bearing / math.sin(bearing) if abs(bearing) > 1e-3 else distance
        fastest = self._fastest * (SLOWEST + (1 - SLOWEST) * min(room / ROOM, 1.0))
        if abs(bend) > 1e-6:
            fastest = min(fastest, self._setup.turn_rate / abs(bend))
        # Nothing is known of what is beyond the arc; before the goal it brakes half as hard.
        fastest = min(fastest, math.sqrt(2 * BRAKE * arc))
        if path.final:
            fastest = min(fastest, math.sqrt(BRAKE * path.left))
        fastest *= max(math.cos(bearing), 0.0)
        return Twist(fastest, fastest * bend)

    def _turn(self, bearing: float, points: np.ndarray) -> Twist:
        """On the spot towards `bearing` (rad), by the other side if only that is free, or back to where there is room to turn."""
        if abs(bearing) < ALIGNED:
            self.stuck = True
            return STOP
        rate = min(max(self._gain * abs(bearing), LEAST_TURN), self._setup.turn_rate)
        sides = (1.0, -1.0) if bearing > 0 else (-1.0, 1.0)
        # What is nearly ahead is not looked for all the way round.
        for side in sides if abs(bearing) > math.pi / 2 else sides[:1]:
            if may_turn(self._body, points, side):
                return Twist(0.0, side * rate)
        if abs(bearing) > math.pi / 2 and may_back_up(self._body, points):
            return Twist(-min(BACK_SPEED, self._setup.speed), 0.0)
        self.stuck = True
        return STOP


def to_robot(points: np.ndarray, estimate: Estimate) -> np.ndarray:
    """`points` (N, 2) m, in the frame of the estimates, as the robot sees them."""
    if not len(points):
        return points
    cosine, sine = math.cos(estimate.heading), math.sin(estimate.heading)
    return (points - (estimate.x, estimate.y)) @ np.array([[cosine, -sine], [sine, cosine]])


def room(body: Footprint, points: np.ndarray, poses: np.ndarray) -> float | None:
    """How far (m) `body` stays from `points` (N, 2) at `poses` (3, K), the first of which it has now; None if it touches one.

    What is within the margin already may come a little nearer, so that it can turn away, but not be touched, or touched harder.
    """
    depths = body.depths(points, poses)
    now = depths[0]
    if (depths[1:] > np.maximum(now, np.minimum(np.maximum(now, 0.0) + GIVE, body.margin))).any():
        return None
    return max(-float(depths.max()), 0.0)


def may_turn(body: Footprint, points: np.ndarray, side: float) -> bool:
    """Whether the robot may turn on the spot a little, to its left if `side` is 1, else -1, past `points` (N, 2) it sees."""
    if not len(points):
        return True
    return room(body, points, np.stack([np.zeros_like(TURNS), np.zeros_like(TURNS), side * TURNS])) is not None


def may_back_up(body: Footprint, points: np.ndarray) -> bool:
    """Whether the robot may go straight back a little past `points` (N, 2) it sees."""
    return not len(points) or room(body, points, np.stack([BACK, np.zeros_like(BACK), np.zeros_like(BACK)])) is not None
