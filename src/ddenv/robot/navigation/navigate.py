"""The controllers `straight` and `costmap`: straight to the goal, or around obstacles with map,
plan, pursuit and recovery.
"""

from __future__ import annotations

import math

import numpy as np

from ddenv.robot.navigation.costmap import Costmap
from ddenv.robot.navigation.footprint import Footprint
from ddenv.robot.navigation.pursuit import BACK_SPEED, BACK_UP, TURN_LEFT, Follower, room
from ddenv.robot.navigation.route import Path, Planner
from ddenv.robot.protocol import STOP, Estimate, Imu, Reading, Setup, Twist
from ddenv.world.pose import Point, wrap

NEAR = 1.5  # clearing the costmap keeps what is within this distance of the robot, m
# After clearing, the lidar gets this time to see obstacles again, s.
LOOK = 0.5
BACK = 0.4  # m
# The maximum duration of a behaviour, s.
LONGEST_BACK = 4.0
LONGEST_TURN = 15.0


class Recovery:
    """Recovery behaviours in turn: clear the map, except near the robot, and look again; back up a
    little; turn around once on the spot; clear all of the map. Robots move only as long as nothing
    is in the way.

    `made` counts the behaviours since the robot last made progress.
    """

    def __init__(self, setup: Setup) -> None:
        self._body = Footprint.of(setup)
        self._most = setup.settings.planner.recoveries
        self._speed = min(BACK_SPEED, setup.speed)
        self._rate = setup.turn_rate
        self.made = 0

    def begin(self, time: float, estimate: Estimate) -> bool:
        """Begins the next behaviour; False once the scenario's maximum number of recoveries is
        reached.
        """
        if self.made >= self._most:
            return False
        self.made += 1
        self._since = time
        self._from = estimate
        self._heading = estimate.heading
        self._turned = 0.0
        return True

    def step(self, time: float, estimate: Estimate, map_: Costmap) -> Twist | None:
        """The command, from the time of `begin` on; None once the behaviour is over."""
        body = self._body
        match (self.made - 1) % 4:
            case 1:
                gone = math.hypot(estimate.x - self._from.x, estimate.y - self._from.y)
                going = gone < BACK and time < self._since + LONGEST_BACK
                may = going and room(body, map_.spots, estimate, BACK_UP) is not None
                if may:
                    return Twist(-self._speed, 0.0)
                return None
            case 2:
                self._turned += wrap(estimate.heading - self._heading)
                self._heading = estimate.heading
                turning = self._turned < math.tau and time < self._since + LONGEST_TURN
                may = turning and room(body, map_.spots, estimate, TURN_LEFT) is not None
                if may:
                    return Twist(0.0, self._rate)
                return None
            case kind:
                if time == self._since:
                    # What is near is kept where the lidar does not look.
                    map_.forget(estimate, NEAR if kind == 0 else 0.0, NEAR)
                if time < self._since + LOOK:
                    return STOP
                return None


# A controller stops when the estimated distance to the goal is within this fraction of its
# tolerance.
ARRIVED = 0.2


class Straight:
    """Drives straight to the goal by proportional heading control, turning on the spot while the
    goal lies behind.

    Once the pose estimate has reached the goal the robot stays there.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._gain = setup.settings.heading_gain
        self._speed = 0.0
        self.arrived = False

    def step(self, reading: Reading) -> Twist:
        """The command for the next period."""
        setup = self._setup
        estimate = reading.estimate
        dx = setup.goal[0] - estimate.x
        dy = setup.goal[1] - estimate.y
        self.arrived = self.arrived or math.hypot(dx, dy) <= ARRIVED * setup.tolerance
        if self.arrived:
            return STOP
        error = wrap(math.atan2(dy, dx) - estimate.heading)
        wanted = setup.speed * max(0.0, math.cos(error))
        # Faster starts lift the front wheels. The robot need not brake gently: it stops well inside
        # the tolerance.
        self._speed = min(wanted, self._speed + setup.acceleration * setup.period)
        turn = min(max(self._gain * error, -setup.turn_rate), setup.turn_rate)
        return Twist(self._speed, turn)


# The robot made progress when it moved this far (m), or turned by this angle (rad).
MOVED = 0.1
TURNED = 0.3
ON_THE_SPOT = 4  # turning alone counts as progress for no longer than this many times the patience


class Progress:
    """Watches whether the robot still makes progress: since when, from its first look on, it has
    neither moved nor turned.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._from: Estimate | None = None
        self._heading = 0.0
        self._moved = self._turned = 0.0

    def is_stalled(self, time: float, estimate: Estimate) -> bool:
        """Whether the robot at `estimate` has made no progress for too long at `time` (s)."""
        if (
            self._from is None
            or math.hypot(estimate.x - self._from.x, estimate.y - self._from.y) >= MOVED
        ):
            self._from = estimate
            self._moved = time
            self._heading = estimate.heading
            self._turned = time
        elif abs(wrap(estimate.heading - self._heading)) >= TURNED:
            self._heading = estimate.heading
            self._turned = time
        return (
            time - self._turned >= self._patience
            or time - self._moved >= ON_THE_SPOT * self._patience
        )


# The minimum time between two scans that the map takes in, s; and while the robot waits in place.
LOOK_EVERY = 0.2
LOOK_WAITING = 0.6
# The minimum time between two plans, s; after this time without any plan the robot starts a
# recovery behaviour, s.
THINK_EVERY = 0.5
THINK = 1.0
# If the robot cannot follow its plan, it makes no new one within this distance (m) of where it made
# the last.
ELSEWHERE = 0.1
TOO_SHORT = (
    2.0  # a plan that ends at the map's border is renewed when less than this (m) is left of it
)
BESIDE = 0.5  # a robot this far (m) off its plan makes a new one
# The robot keeps its plan if a new one is less than this many times shorter and has no more than
# this additional room (m), unless the robot is this far (m) off its plan.
LONGER = 1.1
CLOSER = 0.03
SWAY = 0.2
BETTER = (
    0.5  # this far (m) from its last recovery the robot starts to count its recovery attempts anew
)
TICK = 1e-6  # clocks that add up periods deviate by less than this, s


class Navigator:
    """Drives to the goal around obstacles, as move_base of ROS does: costmap, global plan, pure
    pursuit, recovery behaviours.

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
        self._path: Path | None = None
        self._imu: Imu | None = None
        self._near = self._map.spots
        # When (s) it looked, planned and found a path last; where, and on which version of the map,
        # it planned.
        self._looked = self._planned = -math.inf
        self._found = 0.0
        self._planned_at = setup.start[:2]
        self._planned_on = -1
        self._recovered: Point | None = None
        self._speed = 0.0
        self._recovers = self._blocked = self._waits = False
        self.arrived = self.gave_up = False

    def step(self, reading: Reading) -> Twist:
        """The command for the next period."""
        if self.arrived or self.gave_up:
            return STOP
        self._look(reading)
        self.arrived = self._is_there(reading.estimate)
        if self.arrived:
            return STOP
        twist = self._recover(reading) if self._recovers else self._follow(reading)
        # Faster starts lift the front wheels; braking is not limited.
        most = self._speed + self._setup.acceleration * self._setup.period
        if twist.speed > most:
            twist = Twist(most, twist.turn_rate * most / twist.speed)
        self._speed = max(twist.speed, 0.0)
        self._waits = twist == STOP and not self._recovers and self._path is not None
        return twist

    def _look(self, reading: Reading) -> None:
        """Takes in a scan that is due, collects the points near the robot, and checks whether the
        path is blocked.
        """
        self._imu = reading.imu or self._imu
        every = LOOK_WAITING if self._waits else LOOK_EVERY
        if reading.scan is None or reading.time < self._looked + every - TICK:
            return
        self._looked = reading.time
        self._map.see(reading.scan, reading.estimate, self._imu)
        spots = self._map.spots
        reach = self._follower.reach
        near = (np.abs(spots[0] - reading.estimate.x) < reach) & (
            np.abs(spots[1] - reading.estimate.y) < reach
        )
        self._near = spots[:, near]
        self._blocked = (
            self._path is not None and self._planner.room(self._path, self._map.points) is None
        )

    def _is_there(self, estimate: Estimate) -> bool:
        goal = self._setup.goal
        tolerance = self._setup.tolerance
        left = math.hypot(goal[0] - estimate.x, goal[1] - estimate.y)
        if left <= ARRIVED * tolerance:
            return True
        # Where the goal itself is not free, the end of the plan has to do.
        path = self._path
        return (
            path is not None
            and path.final
            and path.left <= ARRIVED * tolerance
            and left <= tolerance
        )

    def _follow(self, reading: Reading) -> Twist:
        time = reading.time
        estimate = reading.estimate
        self._think(time, estimate)
        if self._path is None:
            if time - self._found >= THINK - TICK:
                return self._try_to_recover(reading)
            return STOP
        twist = self._follower.step(self._path, estimate, self._near)
        if self._progress.is_stalled(time, estimate):
            return self._try_to_recover(reading)
        if self._recovered and math.dist((estimate.x, estimate.y), self._recovered) >= BETTER:
            self._recovery.made = 0
            self._recovered = None
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
        self._planned = time
        self._planned_on = self._map.version
        if not self._planner.is_best(self._path, self._map.points):
            self._plan(time, estimate)

    def _is_spoilt(self, path: Path) -> bool:
        """Whether the path is blocked, the robot cannot follow it or has left it, or it soon ends
        at the map's border.
        """
        if self._blocked or self._follower.stuck or path.off > BESIDE:
            return True
        return not path.final and path.left < TOO_SHORT

    def _plan(self, time: float, estimate: Estimate) -> None:
        self._planned = time
        self._planned_on = self._map.version
        self._planned_at = estimate.x, estimate.y
        path = self._planner.plan(self._map.points, estimate.x, estimate.y)
        if path is not None:
            self._found = time
            path.locate(estimate.x, estimate.y)
        if path is None or not self._is_as_good(path):
            self._path = path
            self._blocked = False

    def _is_as_good(self, other: Path) -> bool:
        """Whether the present path is hardly worse than `other`: a robot that keeps changing its
        plan swerves.
        """
        path = self._path
        points = self._map.points
        if path is None or self._is_spoilt(path) or path.off > SWAY or path.final < other.final:
            return False
        room = self._planner.room(path, points)
        others = self._planner.room(other, points)
        return (
            room is not None
            and room >= (others or 0.0) - CLOSER
            and path.left <= LONGER * other.left
        )

    def _try_to_recover(self, reading: Reading) -> Twist:
        self._recovers = self._recovery.begin(reading.time, reading.estimate)
        self.gave_up = not self._recovers
        if self.gave_up:
            return STOP
        return self._recover(reading)

    def _recover(self, reading: Reading) -> Twist:
        twist = self._recovery.step(reading.time, reading.estimate, self._map)
        if twist is not None:
            return twist
        self._recovers = False
        self._path = None
        self._found = reading.time
        self._planned = -math.inf
        self._recovered = (reading.estimate.x, reading.estimate.y)
        self._progress = Progress(self._setup.settings.planner.patience)
        return STOP
