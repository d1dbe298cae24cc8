"""Pure pursuit of a path: the robot aims at a point ahead on the path, and drives only where its
footprint stays free.
"""

from __future__ import annotations

import math

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.navigation.footprint import Footprint, seen_from
from ddenv.robot.navigation.route import Path
from ddenv.robot.protocol import STOP, Estimate, Setup, Twist
from ddenv.world.pose import Point, wrap

# Parts of the lookahead distance at which the robot aims; the first one whose arc is free counts.
PARTS = (1.0, 0.6)
BRAKE = 1.0  # the deceleration that the robot can rely on, m/s^2
# At a standstill it aims at this part of the lookahead distance: the slower it is, the closer it
# keeps to its path.
NEAREST = 0.4
# It turns on the spot when the path leads farther aside than the first angle, until it is within
# the second, rad.
ASIDE = 0.9
ALONG = 0.25
ALIGNED = (
    0.04  # when it is aligned with its path within this angle (rad) and still not free, it stops
)
# Slower turns than this (rad/s) are lost between the wheels and the ground.
LEAST_TURN = 0.2
BACK_SPEED = 0.25  # m/s
GIVE = 0.001  # a point within the margin may come nearer by this in a step, m
# With this much room (m) around it the robot drives at full speed, with no room at this part of it.
ROOM = 0.35
SLOWEST = 0.25
# With this much room (m) it need not test its arc again for this time, s.
CALM = 0.1
CALM_FOR = 0.1
PLACES = np.linspace(0.0, 1.0, 7)  # the parts of an arc at which the footprint is tested
BENT = 1e-6  # the minimum curvature of an arc, rad: too little to matter
# Small turns on the spot, and a little way back, as poses for `room`.
TURN_LEFT, TURN_RIGHT = (
    np.stack(
        [seen_from(Estimate(0.0, 0.0, side * angle))[:2] for angle in (0.0, 0.1, 0.2, 0.35)], axis=1
    )
    for side in (1.0, -1.0)
)
BACK_UP = np.stack([seen_from(Estimate(-way, 0.0, 0.0))[:2] for way in (0.0, 0.1, 0.2)], axis=1)


class Follower:
    """Follows paths within the limits of `setup`. `stuck` is True if the last step found no free
    way to move.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._gain = setup.settings.heading_gain
        self._look_ahead = setup.settings.planner.look_ahead
        self._body = Footprint.of(setup)
        # Faster, the robot could not stop within the space that it knows to be free.
        self._fastest = min(setup.speed, math.sqrt(2 * BRAKE * self._look_ahead))
        self._path: Path | None = None
        self._points: Floats | None = None
        # An arc that was free, with room, is not tested again for this many steps.
        self._calm = round(CALM_FOR / setup.period)
        self._left = 0
        self._room = 0.0
        self.reach = self._body.circumscribed + self._look_ahead + ROOM + self._body.margin
        self._turning = self.stuck = False

    def step(self, path: Path, estimate: Estimate, points: Floats) -> Twist:
        """The command to follow `path`. `points` (3, N) near the robot are x, y (m) and 1, in the
        frame of the estimates.
        """
        path.locate(estimate.x, estimate.y)
        distance, bearing = self._aim(path, estimate, PARTS[0])
        turning = abs(bearing) > (ALONG if self._turning else ASIDE)
        same = path is self._path and turning == self._turning
        # A stopped robot waits for the next scan.
        if same and self.stuck and points is self._points:
            return STOP
        self._path = path
        self._points = points
        self._turning = turning
        self._left = self._left - 1 if same else -1
        self.stuck = False
        if turning:
            return self._turn(bearing, estimate, points)
        if self._left >= 0:
            return self._drive(path, distance, bearing, self._room)
        for part in PARTS:
            if part != PARTS[0]:
                distance, bearing = self._aim(path, estimate, part)
            arc = None if abs(bearing) > ASIDE else _arc(distance, bearing)
            free = None if arc is None else room(self._body, points, estimate, arc)
            if free is not None:
                self._room = free
                self._left = self._calm if part == PARTS[0] and free >= CALM else 0
                return self._drive(path, distance, bearing, free)
        return self._turn(bearing, estimate, points)

    def _aim(self, path: Path, estimate: Estimate, part: float) -> Point:
        """The distance (m) and the bearing (rad, from straight ahead) of the point that the robot
        aims at.
        """
        share = NEAREST + (1 - NEAREST) * min(max(estimate.speed / self._fastest, 0.0), 1.0)
        x, y = path.ahead(part * share * self._look_ahead)
        dx = x - estimate.x
        dy = y - estimate.y
        return math.hypot(dx, dy), wrap(math.atan2(dy, dx) - estimate.heading)

    def _drive(self, path: Path, distance: float, bearing: float, room: float) -> Twist:
        bend = 2 * math.sin(bearing) / max(distance, 1e-6)
        arc = distance * bearing / math.sin(bearing) if abs(bearing) > 1e-3 else distance
        fastest = self._fastest * (SLOWEST + (1 - SLOWEST) * min(room / ROOM, 1.0))
        if abs(bend) > 1e-6:
            fastest = min(fastest, self._setup.turn_rate / abs(bend))
        # Nothing is known beyond the arc. Before the goal the robot brakes half as hard.
        fastest = min(fastest, math.sqrt(2 * BRAKE * arc))
        if path.final:
            fastest = min(fastest, math.sqrt(BRAKE * path.left))
        fastest *= max(math.cos(bearing), 0.0)
        return Twist(fastest, fastest * bend)

    def _turn(self, bearing: float, estimate: Estimate, points: Floats) -> Twist:
        """Turns on the spot towards `bearing` (rad), the other way round if only that is free, or
        backs up to make room.
        """
        if abs(bearing) < ALIGNED:
            self.stuck = True
            return STOP
        rate = min(max(self._gain * abs(bearing), LEAST_TURN), self._setup.turn_rate)
        sides = [(1.0, TURN_LEFT), (-1.0, TURN_RIGHT)]
        if bearing <= 0:
            sides.reverse()
        # For a small bearing the robot does not turn the long way round.
        for side, places in sides if abs(bearing) > math.pi / 2 else sides[:1]:
            if room(self._body, points, estimate, places) is not None:
                return Twist(0.0, side * rate)
        if abs(bearing) > math.pi / 2 and room(self._body, points, estimate, BACK_UP) is not None:
            return Twist(-min(BACK_SPEED, self._setup.speed), 0.0)
        self.stuck = True
        return STOP


def room(body: Footprint, points: Floats, estimate: Estimate, places: Floats) -> float | None:
    """The distance (m) that `body` keeps from `points` (3, N) at `places` (2, K, 3), see
    `Footprint.apart`; None if it touches one.

    `places` are relative to the robot at `estimate`; the first one is where it is now. A point
    within the margin may come a little nearer, so that the robot can turn away from it, but must
    not be touched, or touched harder.
    """
    if not points.shape[1]:
        return ROOM
    apart = body.apart(points, places @ seen_from(estimate))
    least = float(apart.min())
    if least >= 0:
        return least
    now = apart[0]
    nearest = apart[1:].min(axis=0)
    may = np.minimum(now, np.maximum(np.minimum(now, 0.0) - GIVE, -body.margin))
    if (nearest < may).any():
        return None
    return 0.0


def _arc(distance: float, bearing: float) -> Floats:
    """Poses on the arc from the robot to its aim, (2, K, 3), as for `Footprint.apart`."""
    bearing = math.copysign(max(abs(bearing), BENT), bearing)
    radius = distance / (2 * math.sin(bearing))
    headings = PLACES * (2 * bearing)
    places = np.empty((2, len(PLACES), 3))
    along, across = places
    along[:, 0] = across[:, 1] = cosines = np.cos(headings)
    along[:, 1] = sines = np.sin(headings)
    across[:, 0] = -sines
    along[:, 2] = -radius * sines
    across[:, 2] = radius - radius * cosines
    return places
