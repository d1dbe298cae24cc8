"""Whether a robot is stuck for good, so that the rest of its run would show nothing new."""

from __future__ import annotations

import math

from ddenv.world.scenario import Controller

PoseRow = tuple[float, ...]

# Who stays within so many m and rad for so long (s) is stuck. Wheels that slip in a rut rock a robot by less; one that turns on the
# spot, or backs up, leaves these limits in a fraction of a second.
RADIUS = 0.05
ANGLE = math.radians(5)
SECONDS = 8.0

# The controller `costmap` first stands still for its patience, clears its map and waits as long again before it backs up and
# turns: whoever watches must be more patient than that.
PATIENCES = 3.0


def seconds_for(controller: Controller) -> float:
    """How long a robot with this controller must not move to be stuck for good, s."""
    return max(SECONDS, PATIENCES * controller.planner.patience) if controller.use == "costmap" else SECONDS


class Stuck:
    """Is told each recorded pose of one run, in order of time.

    It is a guess: a robot may still come free later. That is why full runs confirm what is left after runs that were cut.
    """

    def __init__(self, seconds: float = SECONDS) -> None:
        self._seconds = seconds
        self._since = 0.0
        self._place: PoseRow | None = None

    def update(self, now: float, pose: PoseRow) -> bool:
        """Whether the robot is stuck at `now` (s); `pose` is x, y, z (m), qw, qx, qy, qz."""
        if self._place is None or _has_left(self._place, pose):
            self._since, self._place = now, pose
        # Times are sums of steps: what is due in 8 s may come 1e-15 s early.
        return now - self._since >= self._seconds - 1e-6


def _has_left(place: PoseRow, pose: PoseRow) -> bool:
    if math.dist(place[:3], pose[:3]) > RADIUS:
        return True
    # A rotation has two quaternions.
    likeness = abs(sum(a * b for a, b in zip(place[3:], pose[3:], strict=True)))
    return 2 * math.acos(min(1.0, likeness)) > ANGLE
