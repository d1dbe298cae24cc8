"""When a run may end early: its controller has stopped, and the robot rests well inside or outside
epsilon.
"""

from __future__ import annotations

import math

from ddenv.robot.result import Ends
from ddenv.world.pose import Vector
from ddenv.world.scenario import Goal

# What is slower than this is still, m/s or rad/s.
SLOW = 0.02
# A robot has to be still for this time (s) before its run may end.
SECONDS = 2.0
# A still robot may slide this far (m) besides what it has slid since it became still, going on as
# if it fell: on a slippery slope it does.
NUDGE = 0.01


class Rest:
    """Decides for one run whether it may end before its time is up, at `until` (s).

    Resting is not enough: robots that stood with stalled wheels for 8 s came free, since the noise
    of a sensor changed what their controller wanted. So the run goes on until its controller has
    stopped for good.
    """

    def __init__(self, ends: Ends, goal: Goal, until: float) -> None:
        self._ends = ends
        self._goal = goal
        self._until = until
        self._since = 0.0
        self._place: Vector | None = None
        # The greatest distance from there so far, m.
        self._slid = 0.0

    def update(self, now: float, place: Vector, still: bool) -> bool:
        """Whether the run may end at `now` (s), with the robot at `place` (m). Call it for each
        recorded pose, in order of time.

        `still`: the controller has stopped for good, and nothing in the world moves.
        """
        if not still:
            self._place = None
            return False
        if self._place is None:
            self._since = now
            self._place = place
            self._slid = 0.0
        self._slid = max(self._slid, math.dist(place, self._place))
        rested = now - self._since
        # Times are sums of steps: 2 s may come out 1e-15 s short.
        if rested < SECONDS - 1e-6:
            return False
        slides = self._slid * ((self._until - self._since) / rested) ** 2 + NUDGE
        to_goal = math.hypot(self._goal.x - place[0], self._goal.y - place[1])
        return to_goal - slides > self._goal.tolerance and self._ends.decide(place, slides)
