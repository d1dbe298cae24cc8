"""Go-to-goal driving: from where the robot believes it is to a speed and a turn rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ddenv.robot.estimate import Estimate, wrap
from ddenv.world.scenario import Controller, Goal

# The robot stops when it believes to be this far inside the goal's tolerance (a fraction of it).
ARRIVED = 0.2


@dataclass(frozen=True, slots=True)
class Command:
    """Forward speed in m/s and turn rate in rad/s, positive to the left."""

    speed: float
    turn_rate: float


STOP = Command(0.0, 0.0)


class Navigator:
    """Drives to the goal in a straight line, turning on the spot when it lies behind. Once it believes to be there it stays."""

    def __init__(self, goal: Goal, controller: Controller) -> None:
        self._goal = goal
        self._controller = controller
        self._speed = 0.0
        self.arrived = False

    def command(self, estimate: Estimate) -> Command:
        """The command for the next period."""
        dx, dy = self._goal.x - estimate.x, self._goal.y - estimate.y
        self.arrived = self.arrived or math.hypot(dx, dy) <= ARRIVED * self._goal.tolerance
        if self.arrived:
            return STOP
        settings = self._controller
        error = wrap(math.atan2(dy, dx) - estimate.heading)
        wanted = settings.speed * max(0.0, math.cos(error))
        # Faster starts lift the front wheels; slowing down is left to the goal's tolerance.
        self._speed = min(wanted, self._speed + settings.acceleration * settings.period)
        turn = min(max(settings.heading_gain * error, -settings.turn_rate), settings.turn_rate)
        return Command(self._speed, turn)
