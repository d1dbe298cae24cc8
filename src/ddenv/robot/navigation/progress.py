"""Whether the robot gets further."""

from __future__ import annotations

import math

from ddenv.robot.sensing.estimate import Estimate, wrap

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
