"""Navigation around what the lidar sees: map, plan, follow, and recover when that leads nowhere."""

from __future__ import annotations

import math

import numpy as np

from ddenv.robot.navigation.costmap import Costmap
from ddenv.robot.navigation.pursuit import Follower
from ddenv.robot.navigation.recover import Attempt, Recovery
from ddenv.robot.navigation.route import Path, Planner
from ddenv.robot.protocol import STOP, Reading, Setup, Twist
from ddenv.robot.sensing.estimate import Estimate, wrap
from ddenv.robot.sensing.sensors import Imu

# The robot stops when it believes to be this far inside the goal's tolerance (a fraction of it).
ARRIVED = 0.2


class Straight:
    """Drives to the goal in a straight line, turning on the spot when it lies behind. Once it believes to be there it stays."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._gain = setup.settings.heading_gain
        self._speed = 0.0
        self.arrived = False

    def step(self, reading: Reading) -> Twist:
        """The command for the next period."""
        setup, estimate = self._setup, reading.estimate
        dx, dy = setup.goal[0] - estimate.x, setup.goal[1] - estimate.y
        self.arrived = self.arrived or math.hypot(dx, dy) <= ARRIVED * setup.tolerance
        if self.arrived:
            return STOP
        error = wrap(math.atan2(dy, dx) - estimate.heading)
        wanted = setup.speed * max(0.0, math.cos(error))
        # Faster starts lift the front wheels; slowing down is left to the goal's tolerance.
        self._speed = min(wanted, self._speed + setup.acceleration * setup.period)
        turn = min(max(self._gain * error, -setup.turn_rate), setup.turn_rate)
        return Twist(self._speed, turn)


# It moved if it is this far (m) from where it was, or turned by this (rad).
MOVED = 0.1
TURNED = 0.3
# Turning alone counts for no longer than this many times the patience.
ON_THE_SPOT = 4


class Progress:
    """Remembers where the robot last got further, and since when it does not."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._from: Estimate | None = None
        self._heading = 0.0
        self._moved = self._turned = 0.0

    def begin(self) -> None:
        """From now on it has to get further again."""
        self._from = None

    def is_stalled(self, time: float, estimate: Estimate) -> bool:
        """Whether the robot at `estimate` has not moved for too long."""
        if self._from is None or math.hypot(estimate.x - self._from.x, estimate.y - self._from.y) >= MOVED:
            self._from, self._moved = estimate, time
            self._heading, self._turned = estimate.heading, time
        elif abs(wrap(estimate.heading - self._heading)) >= TURNED:
            self._heading, self._turned = estimate.heading, time
        return time - self._turned >= self._patience or time - self._moved >= ON_THE_SPOT * self._patience


# Scans that come faster than this (s) are left out, and of a robot that waits where it is, these.
LOOK_EVERY = 0.2
LOOK_WAITING = 0.6
# Between two plans, at least, s; and without a plan for so long, the robot tries to recover, s.
THINK_EVERY = 0.5
THINK = 1.0
# Where it could not follow its plan, it makes no other one so soon until it is this far (m) away.
ELSEWHERE = 0.1
# A plan that ends at the map's border is made anew when less than this (m) is left of it.
TOO_SHORT = 2.0
# Farther beside its plan than this (m), the robot makes another.
BESIDE = 0.5
# It stays with its plan if another is hardly shorter or roomier (m), unless it is so far (m) beside it.
LONGER = 1.1
CLOSER = 0.03
SWAY = 0.2
# So far (m) from where it last recovered, it begins to count its attempts anew.
BETTER = 0.5
# Clocks that add up periods are off by less, s.
TICK = 1e-6


class Navigator:
    """Drives to the goal around obstacles. `arrived` and `gave_up` are for good: the robot stays where it is."""

    def __init__(self, setup: Setup) -> None:
        planner = setup.settings.planner
        self._setup = setup
        self._map = Costmap(setup)
        self._planner = Planner(setup)
        self._replan = max(planner.replan, THINK_EVERY)
        self._follower = Follower(setup)
        self._progress = Progress(planner.patience)
        self._recovery = Recovery(setup)
        self._attempt: Attempt | None = None
        self._path: Path | None = None
        self._imu: Imu | None = None
        self._near = self._map.spots
        self._looked = self._planned = -math.inf
        self._planned_at = setup.start[:2]
        self._found = 0.0
        self._planned_on = -1
        self._blocked = False
        self._recovered: tuple[float, float] | None = None
        self._speed = 0.0
        self._waits = False
        self.arrived = False
        self.gave_up = False

    def step(self, reading: Reading) -> Twist:
        """The command for the next period."""
        if self.arrived or self.gave_up:
            return STOP
        self._look(reading)
        self.arrived = self._is_there(reading.estimate)
        if self.arrived:
            return STOP
        twist = self._recover(reading) if self._attempt else self._follow(reading)
        # Faster starts lift the front wheels; it may always brake.
        most = self._speed + self._setup.acceleration * self._setup.period
        if twist.speed > most:
            twist = Twist(most, twist.turn_rate * most / twist.speed)
        self._speed = max(twist.speed, 0.0)
        self._waits = twist == STOP and self._attempt is None and self._path is not None
        return twist

    def _look(self, reading: Reading) -> None:
        self._imu = reading.imu or self._imu
        every = LOOK_WAITING if self._waits else LOOK_EVERY
        if reading.scan is None or reading.time < self._looked + every - TICK:
            return
        self._looked = reading.time
        self._map.see(reading.scan, reading.estimate, self._imu)
        self._see(reading.estimate)

    def _see(self, estimate: Estimate) -> None:
        """Note what the map has to say about the path."""
        spots, reach = self._map.spots, self._follower.reach
        near = (np.abs(spots[0] - estimate.x) < reach) & (np.abs(spots[1] - estimate.y) < reach)
        self._near = spots[:, near]
        self._blocked = self._path is not None and self._planner.room(self._path, self._map.points) is None

    def _is_there(self, estimate: Estimate) -> bool:
        goal, tolerance = self._setup.goal, self._setup.tolerance
        left = math.hypot(goal[0] - estimate.x, goal[1] - estimate.y)
        if left <= ARRIVED * tolerance:
            return True
        # Where the goal itself is not free, the end of the plan must do.
        path = self._path
        return path is not None and path.final and path.left <= ARRIVED * tolerance and left <= tolerance

    def _follow(self, reading: Reading) -> Twist:
        time, estimate = reading.time, reading.estimate
        self._think(time, estimate)
        if self._path is None:
            return self._try_to_recover(reading) if time - self._found >= THINK - TICK else STOP
        twist = self._follower.step(self._path, estimate, self._near)
        if self._progress.is_stalled(time, estimate):
            return self._try_to_recover(reading)
        self._note_progress(estimate)
        return twist

    def _think(self, time: float, estimate: Estimate) -> None:
        """Plan if there is a reason to, and from time to time if the map has changed."""
        since = time - self._planned + TICK
        is_due = since >= self._replan and self._map.version != self._planned_on
        if self._path is None or self._is_spoilt(self._path):
            if since >= THINK_EVERY and (is_due or not self._is_no_use(estimate)):
                self._plan(time, estimate)
            return
        if not is_due:
            return
        self._planned, self._planned_on = time, self._map.version
        if not self._planner.is_best(self._path, self._map.points):
            self._plan(time, estimate)

    def _is_no_use(self, estimate: Estimate) -> bool:
        """Whether another plan would leave the robot where it is, too: this one was made from here, and it cannot follow it."""
        if not self._follower.stuck or self._blocked:
            return False
        return math.dist(self._planned_at, (estimate.x, estimate.y)) < ELSEWHERE

    def _is_spoilt(self, path: Path) -> bool:
        """Whether something is in the way, the robot has left it, or it ends soon at the map's border."""
        if self._blocked or self._follower.stuck or path.off > BESIDE:
            return True
        return not path.final and path.left < TOO_SHORT

    def _plan(self, time: float, estimate: Estimate) -> None:
        self._planned, self._planned_on = time, self._map.version
        self._planned_at = estimate.x, estimate.y
        path = self._planner.plan(self._map.points, estimate.x, estimate.y)
        if path is not None:
            self._found = time
            path.locate(estimate.x, estimate.y)
        if path is None or not self._is_as_good(path):
            self._path, self._blocked = path, False

    def _is_as_good(self, other: Path) -> bool:
        """Whether the path is hardly worse than `other`: a robot that changes its mind all the time sways."""
        path, points = self._path, self._map.points
        if path is None or self._is_spoilt(path) or path.off > SWAY or path.final < other.final:
            return False
        room, others = self._planner.room(path, points), self._planner.room(other, points)
        return room is not None and room >= (others or 0.0) - CLOSER and path.left <= LONGER * other.left

    def _note_progress(self, estimate: Estimate) -> None:
        was = self._recovered
        if was and math.hypot(estimate.x - was[0], estimate.y - was[1]) >= BETTER:
            self._recovery.made = 0
            self._recovered = None

    def _try_to_recover(self, reading: Reading) -> Twist:
        self._attempt = self._recovery.next(reading.time, reading.estimate)
        self.gave_up = self._attempt is None
        return STOP if self.gave_up else self._recover(reading)

    def _recover(self, reading: Reading) -> Twist:
        twist = self._attempt.step(reading.time, reading.estimate, self._map)
        if twist is not None:
            return twist
        self._attempt = self._path = None
        self._found = reading.time
        self._planned = -math.inf
        self._recovered = (reading.estimate.x, reading.estimate.y)
        self._progress.begin()
        return STOP
