"""Where in a test the playback is, and how fast it goes."""

from __future__ import annotations

from bisect import bisect_left

from ddenv.runs.playback import FRAME

# Simulated seconds in a second.
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
USUAL = 4.0
# One long step, simulated s.
STEP = 1.0


class Playing:
    """At simulated `time`, s, of `length`; it runs at `speed` while `on`."""

    def __init__(self, length: float) -> None:
        self.length, self.time, self.speed, self.on = length, 0.0, USUAL, False

    @property
    def at_end(self) -> bool:
        return self.time >= self.length

    def go(self, time: float) -> None:
        """To an instant, and stops there."""
        self.on = False
        self.time = min(max(0.0, time), self.length)

    def frames(self, number: int) -> None:
        """So many frames on, or back if negative: to the instants at which the run file has a row."""
        frame = round(self.time / FRAME, 6)
        whole = int(frame) if number > 0 else -int(-frame // 1)
        self.go((whole + number) * FRAME)

    def toggle(self) -> None:
        """Plays, or pauses; at the end it begins again."""
        if not self.on and self.at_end:
            self.time = 0.0
        self.on = not self.on and self.length > 0

    def faster(self, steps: int) -> bool:
        """Another of the `SPEEDS`; False if there is none."""
        place = bisect_left(SPEEDS, self.speed) + steps
        if not 0 <= place < len(SPEEDS):
            return False
        self.speed = SPEEDS[place]
        return True

    def advance(self, seconds: float) -> None:
        """So many seconds of real time pass."""
        if self.on:
            self.time = min(self.length, self.time + seconds * self.speed)
            self.on = not self.at_end
