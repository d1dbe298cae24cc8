"""Go-to-goal driving: from where the robot believes it is to a speed and a turn rate."""

from __future__ import annotations

import math

from ddenv.robot.protocol import STOP, Reading, Setup, Twist
from ddenv.robot.sensing.estimate import wrap

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
