"""What the robot meets in the tests that are played back, up to the instant that is shown and after
it.
"""

from __future__ import annotations

from bisect import bisect_right
from operator import itemgetter

from rich.text import Text
from textual.widget import Widget

from ddenv.runfile.state import Test
from ddenv.text import Names, plain, shortened
from ddenv.words.early_stop import WHY, ended_early
from ddenv.words.signs import OUTCOME
from ddenv.workbench.playback.timeline import ROBOTS

HERE = "▸"
# The maximum number of lines of a test.
LOGGED = 400


def met(test: Test) -> tuple[tuple[float, str], ...]:
    """What the robot met in a test, and when, simulated s."""
    said = [(at, 0, f"senses {plain(name)}") for name, at in test.first_sensed]
    said += [(at, 1, f"touches {plain(name)}") for name, at in test.first_touched]
    lines = [(at, words) for at, _, words in sorted(said)]
    if len(lines) > LOGGED:
        lines = [*lines[:LOGGED], (lines[LOGGED][0], f"and {len(lines) - LOGGED} more such lines")]
    if test.is_finished:
        lines.append((test.simulated_seconds, how_it_ended(test)))
    return ((0.0, "starts"), *lines)


def how_it_ended(test: Test) -> str:
    if test.outcome == "running":
        return "▶ running"
    why = f": {plain(test.failure)}" if test.failure else ""
    early = f", {ended_early(test)}: {WHY}" if test.cut else ""
    return f"{OUTCOME.get(test.outcome, test.outcome)}{why}{early}"


class Met(Widget):
    """The lines around the instant; what is still to come is dim. `lacks` stand above them."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        # When, in which test by its sign, and what.
        self._lines: list[tuple[float, str, str]] = []
        self._lacks: Names = ()
        self._now = 0

    def put(self, tests: tuple[Test, ...], lacks: Names) -> None:
        signs = ROBOTS if len(tests) > 1 else ("",)
        lines = (
            (at, sign, words)
            for sign, test in zip(signs, tests, strict=False)
            for at, words in met(test)
        )
        self._lines = sorted(lines, key=itemgetter(0))
        self._lacks = lacks
        self._now = 0
        self.refresh()

    def show(self, time: float) -> None:
        """Another instant, simulated s."""
        now = bisect_right(self._lines, time, key=itemgetter(0))
        if now != self._now:
            self._now = now
            self.refresh()

    def render(self) -> Text:
        width, height = self.size
        lacks = Text("\n".join(f"▲ {plain(words)}" for words in self._lacks), "bold")
        above = lacks.wrap(self.app.console, max(1, width)) if self._lacks else ()
        text = Text("", no_wrap=True, overflow="ellipsis")
        for line in above:
            text.append_text(line).append("\n")
        room = max(1, height - len(above))
        # The latest line stands in the middle once there are more than fit.
        first = max(0, min(self._now - room // 2 - 1, len(self._lines) - room))
        for number, (at, sign, words) in enumerate(self._lines[first : first + room], first):
            here = HERE if number == self._now - 1 else " "
            head = f"{here}{at:6.1f} s {sign}{' ' if sign else ''}"
            what = shortened(words, max(4, width - len(head)))
            text.append(f"{head}{what}\n", "" if number < self._now else "dim")
        return text
