"""A controller that heads for its goal, and gets around what its lidar sees ahead on the side with
more room.
"""

import math

import numpy as np

from ddenv import Reading, Setup, Twist

AHEAD = 0.7  # rad, to either side


class Timid:
    """Turns away from what is near, goes straight for a while, and forgets it."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.keep_away = setup.footprint[0] + setup.options["clearance"]  # m
        self.nearest = (math.inf, math.inf)  # m, ahead on the left and on the right
        self.straight_until = 0.0  # s
        self.arrived = False

    def step(self, reading: Reading) -> Twist:
        setup, at = self.setup, reading.estimate
        if reading.scan is not None:
            angles, ranges = reading.scan.angles, reading.scan.ranges
            sides = (angles >= 0) & (angles < AHEAD), (angles < 0) & (angles > -AHEAD)
            self.nearest = tuple(float(np.min(ranges[side])) for side in sides)
        x, y = setup.goal[0] - at.x, setup.goal[1] - at.y
        self.arrived = self.arrived or math.hypot(x, y) < setup.tolerance / 2
        if self.arrived:
            return Twist(0.0, 0.0)
        left, right = self.nearest
        if min(left, right) < self.keep_away:
            self.straight_until = reading.time + setup.options["straight"]
            return Twist(0.0, setup.turn_rate if left > right else -setup.turn_rate)
        if reading.time < self.straight_until:
            return Twist(setup.speed, 0.0)
        error = math.remainder(math.atan2(y, x) - at.heading, math.tau)
        turn = min(max(2.0 * error, -setup.turn_rate), setup.turn_rate)
        return Twist(setup.speed * max(math.cos(error), 0.0), turn)
