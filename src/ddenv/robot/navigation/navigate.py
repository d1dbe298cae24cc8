"""The controllers `straight` and `costmap`: straight to the goal, or around obstacles with map, plan, pursuit and recovery."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ddenv.robot.navigation.costmap import Costmap
from ddenv.robot.navigation.footprint import Footprint
from ddenv.robot.navigation.pursuit import BACK_SPEED, Follower, may_back_up, may_turn
from ddenv.robot.navigation.route import Path, Planner
from ddenv.robot.protocol import STOP, Estimate, Imu, Reading, Setup, Twist
from ddenv.world.pose import wrap

# Clearing the costmap keeps what is within this distance of the robot, m.
NEAR = 1.5
# After clearing, the lidar gets this time to see obstacles again, s.
LOOK = 0.5
BACK = 0.4  # m
# The maximum duration of a behaviour, s.
LONGEST_BACK = 4.0
LONGEST_TURN = 15.0


class Attempt(Protocol):
    """A recovery behaviour: commands until it is over, then None."""

    def step(self, time: float, estimate: Estimate, map_: Costmap) -> Twist | None: ...


class Forget:
    """Clears the costmap beyond `beyond` (m) and looks again. It keeps what is near and outside the lidar's field of view."""

    def __init__(self, setup: Setup, time: float, estimate: Estimate, beyond: float) -> None:
        self._until = time + LOOK
        self._beyond: float | None = beyond

    def step(self, time: float, estimate: Estimate, map_: Costmap) -> Twist | None:
        if self._beyond is not None:
            map_.forget(estimate, self._beyond, NEAR)
            self._beyond = None
        return STOP if time < self._until else None


class BackUp:
    """Backs up a little, as long as nothing is there."""

    def __init__(self, setup: Setup, time: float, estimate: Estimate) -> None:
        self._body = Footprint.of(setup)
        self._speed = min(BACK_SPEED, setup.speed)
        self._from = estimate
        self._until = time + LONGEST_BACK

    def step(self, time: float, estimate: Estimate, map_: Costmap) -> Twist | None:
        gone = math.hypot(estimate.x - self._from.x, estimate.y - self._from.y)
        if gone >= BACK or time >= self._until:
            return None
        return Twist(-self._speed, 0.0) if may_back_up(self._body, map_.spots, estimate) else None


class LookAround:
    """Turns around once on the spot, as long as nothing is in the way."""

    def __init__(self, setup: Setup, time: float, estimate: Estimate) -> None:
        self._body = Footprint.of(setup)
        self._rate = setup.turn_rate
        self._heading = estimate.heading
        self._turned = 0.0
        self._until = time + LONGEST_TURN

    def step(self, time: float, estimate: Estimate, map_: Costmap) -> Twist | None:
        self._turned += wrap(estimate.heading - self._heading)
        self._heading = estimate.heading
        if self._turned >= math.tau or time >= self._until:
            return None
        return Twist(0.0, self._rate) if may_turn(self._body, map_.spots, estimate, 1.0) else None


@dataclass(slots=True)
class Recovery:
    """Chooses recovery behaviours in turn. `made` counts those since the robot last made progress."""

    setup: Setup
    made: int = 0

    def next(self, time: float, estimate: Estimate) -> Attempt | None:
        """The next behaviour; None once the scenario's maximum number of recoveries is reached."""
        if self.made >= self.setup.settings.planner.recoveries:
            return None
        self.made += 1
        match (self.made - 1) % 4:
            case 0:
                return Forget(self.setup, time, estimate, NEAR)
            case 1:
                return BackUp(self.setup, time, estimate)
            case 2:
                return LookAround(self.setup, time, estimate)
            case _:
                return Forget(self.setup, time, estimate, 0.0)


# A controller stops when the estimated distance to the goal is within this fraction of its tolerance.
ARRIVED = 0.2


class Straight:
    """Drives straight to the goal by proportional heading control, turning on the spot while the goal lies behind.

    Once the pose estimate has reached the goal the robot stays there.
    """

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
        # Faster starts lift the front wheels. The robot need not brake gently: it stops well inside the tolerance.
        self._speed = min(wanted, self._speed + setup.acceleration * setup.period)
        turn = min(max(self._gain * error, -setup.turn_rate), setup.turn_rate)
        return Twist(self._speed, turn)


# The robot made progress when it moved this far (m), or turned by this angle (rad).
MOVED = 0.1
TURNED = 0.3
# Turning alone counts as progress for no longer than this many times the patience.
ON_THE_SPOT = 4


class Progress:
    """Watches whether the robot still makes progress: since when it has neither moved nor turned."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._from: Estimate | None = None
        self._heading = 0.0
        self._moved = self._turned = 0.0

    def begin(self) -> None:
        """Forgets the past: from now on the robot has to make progress again."""
        self._from = None

    def is_stalled(self, time: float, estimate: Estimate) -> bool:
        """Whether the robot at `estimate` has made no progress for too long at `time` (s)."""
        if self._from is None or math.hypot(estimate.x - self._from.x, estimate.y - self._from.y) >= MOVED:
            self._from, self._moved = estimate, time
            self._heading, self._turned = estimate.heading, time
        elif abs(wrap(estimate.heading - self._heading)) >= TURNED:
            self._heading, self._turned = estimate.heading, time
        return time - self._turned >= self._patience or time - self._moved >= ON_THE_SPOT * self._patience


# The minimum time between two scans that the map takes in, s; and while the robot waits in place.
LOOK_EVERY = 0.2
LOOK_WAITING = 0.6
# The minimum time between two plans, s; after this time without any plan the robot starts a recovery behaviour, s.
THINK_EVERY = 0.5
THINK = 1.0
# If the robot cannot follow its plan, it makes no new one within this distance (m) of where it made the last.
ELSEWHERE = 0.1
# A plan that ends at the map's border is renewed when less than this (m) is left of it.
TOO_SHORT = 2.0
# A robot this far (m) off its plan makes a new one.
BESIDE = 0.5
# The robot keeps its plan if a new one is less than this many times shorter and has no more than this additional room (m), unless
# the robot is this far (m) off its plan.
LONGER = 1.1
CLOSER = 0.03
SWAY = 0.2
# This far (m) from its last recovery the robot starts to count its recovery attempts anew.
BETTER = 0.5
# Clocks that add up periods deviate by less than this, s.
TICK = 1e-6


class Navigator:
    """Drives to the goal around obstacles, as move_base of ROS does: costmap, global plan, pure pursuit, recovery behaviours.

    `arrived` and `gave_up` are final: the robot then stays where it is.
    """

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
        # Faster starts lift the front wheels; braking is not limited.
        most = self._speed + self._setup.acceleration * self._setup.period
        if twist.speed > most:
            twist = Twist(most, twist.turn_rate * most / twist.speed)
        self._speed = max(twist.speed, 0.0)
        self._waits = twist == STOP and self._attempt is None and self._path is not None
        return twist

    def _look(self, reading: Reading) -> None:
        """Takes in a scan that is due, collects the points near the robot, and checks whether the path is blocked."""
        self._imu = reading.imu or self._imu
        every = LOOK_WAITING if self._waits else LOOK_EVERY
        if reading.scan is None or reading.time < self._looked + every - TICK:
            return
        self._looked = reading.time
        self._map.see(reading.scan, reading.estimate, self._imu)
        spots, reach = self._map.spots, self._follower.reach
        near = (np.abs(spots[0] - reading.estimate.x) < reach) & (np.abs(spots[1] - reading.estimate.y) < reach)
        self._near = spots[:, near]
        self._blocked = self._path is not None and self._planner.room(self._path, self._map.points) is None

    def _is_there(self, estimate: Estimate) -> bool:
        goal, tolerance = self._setup.goal, self._setup.tolerance
        left = math.hypot(goal[0] - estimate.x, goal[1] - estimate.y)
        if left <= ARRIVED * tolerance:
            return True
        # Where the goal itself is not free, the end of the plan has to do.
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
        if self._recovered and math.dist((estimate.x, estimate.y), self._recovered) >= BETTER:
            self._recovery.made, self._recovered = 0, None
        return twist

    def _think(self, time: float, estimate: Estimate) -> None:
        """Plans if there is a reason to, and from time to time if the map has changed."""
        since = time - self._planned + TICK
        is_due = since >= self._replan and self._map.version != self._planned_on
        if self._path is None or self._is_spoilt(self._path):
            here = math.dist(self._planned_at, (estimate.x, estimate.y)) < ELSEWHERE
            # A new plan would not help: the last one was made here, and the robot cannot follow it.
            no_use = self._follower.stuck and not self._blocked and here
            if since >= THINK_EVERY and (is_due or not no_use):
                self._plan(time, estimate)
            return
        if not is_due:
            return
        self._planned, self._planned_on = time, self._map.version
        if not self._planner.is_best(self._path, self._map.points):
            self._plan(time, estimate)

    def _is_spoilt(self, path: Path) -> bool:
        """Whether the path is blocked, the robot cannot follow it or has left it, or it soon ends at the map's border."""
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
        """Whether the present path is hardly worse than `other`: a robot that keeps changing its plan swerves."""
        path, points = self._path, self._map.points
        if path is None or self._is_spoilt(path) or path.off > SWAY or path.final < other.final:
            return False
        room, others = self._planner.room(path, points), self._planner.room(other, points)
        return room is not None and room >= (others or 0.0) - CLOSER and path.left <= LONGER * other.left

    def _try_to_recover(self, reading: Reading) -> Twist:
        self._attempt = self._recovery.next(reading.time, reading.estimate)
        self.gave_up = self._attempt is None
        return STOP if self.gave_up else self._recover(reading)

    def _recover(self, reading: Reading) -> Twist:
        twist = self._attempt.step(reading.time, reading.estimate, self._map) if self._attempt else None
        if twist is not None:
            return twist
        self._attempt = self._path = None
        self._found = reading.time
        self._planned = -math.inf
        self._recovered = (reading.estimate.x, reading.estimate.y)
        self._progress.begin()
        return STOP
