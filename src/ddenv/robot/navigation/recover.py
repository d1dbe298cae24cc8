"""Recovery behaviours: what the robot tries, one after another, when it makes no progress, as move_base of ROS does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from ddenv.robot.navigation.costmap import Costmap
from ddenv.robot.navigation.footprint import Footprint
from ddenv.robot.navigation.pursuit import BACK_SPEED, may_back_up, may_turn
from ddenv.robot.protocol import STOP, Setup, Twist
from ddenv.robot.sensing.estimate import Estimate, wrap

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
