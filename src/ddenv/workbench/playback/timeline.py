"""The time within a test as a slider: a line for each test, with the instant, its end, first
touches, and when two part.
"""

from __future__ import annotations

from collections.abc import Callable

from rich.text import Text
from textual import events
from textual.widget import Widget

from ddenv.runs.playback import Played
from ddenv.words.signs import outcome
from ddenv.workbench.map.map_words import PARTING

GONE = "━"
COMING = "─"
NOW = "●"
END = "┤"
TOUCH = "▾"
ROBOTS = "→⇒"
# The width of the sign before a line, and the greatest of the words after it.
SIGN = 2
WORDS = 24


class Timeline(Widget):
    """Click or drag to an instant; the wheel goes from frame to frame."""

    ALLOW_SELECT = False
    DEFAULT_CSS = "Timeline { height: auto; }"

    def __init__(
        self, go: Callable[[float], None], turn: Callable[[int], None], *, id: str
    ) -> None:
        """`go` is called with the simulated time, s, that the user wants to see, `turn` with so
        many frames.
        """
        super().__init__(id=id)
        self._go = go
        self._turn = turn
        self._time = 0.0
        self._parting: float | None = None
        self._tests: tuple[Played, ...] = ()
        self._dragging = False

    def show(self, time: float, tests: tuple[Played, ...], parting: float | None) -> None:
        """The instant, simulated s, in these tests, and when they part, if so."""
        taller = len(tests) != len(self._tests)
        self._time = time
        self._tests = tests
        self._parting = parting
        self.refresh(layout=taller)

    def render(self) -> Text:
        return Text("\n", no_wrap=True).join(map(self._line, ROBOTS, self._tests))

    @property
    def _length(self) -> float:
        return max((one.length for one in self._tests), default=0.0)

    @property
    def _words(self) -> int:
        return min(
            WORDS,
            max((len(outcome(one.test)) for one in self._tests), default=0),
            self.size.width // 3,
        )

    @property
    def _room(self) -> int:
        return max(2, self.size.width - SIGN - self._words - 1)

    def _cell(self, time: float) -> int:
        part = time / self._length if self._length > 0 else 0.0
        return min(self._room - 1, max(0, round(part * (self._room - 1))))

    def _line(self, robot: str, one: Played) -> Text:
        last = self._cell(one.length)
        now = self._cell(self._time)
        cells = [GONE if cell < now else COMING for cell in range(last + 1)] + [" "] * (
            self._room - 1 - last
        )
        for _, at in one.test.first_touched:
            if at <= one.length:
                cells[self._cell(at)] = TOUCH
        cells[last] = END
        if self._parting is not None:
            cells[self._cell(self._parting)] = PARTING
        cells[now] = NOW
        text = Text(f"{robot} ", "bold", no_wrap=True).append("".join(cells), "not bold")
        text.stylize("bold", SIGN, SIGN + now + 1)
        return text.append(f" {outcome(one.test)[: self._words]}", "not bold")

    def _go_to(self, x: int) -> None:
        self._go(max(0.0, min(1.0, (x - SIGN) / (self._room - 1))) * self._length)

    def on_mouse_down(self, event: events.MouseDown) -> None:
        if event.button == 1 and SIGN <= event.x < SIGN + self._room:
            self._dragging = True
            self.capture_mouse()
            self._go_to(event.x)

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._dragging:
            self._go_to(event.x)

    def on_mouse_up(self, event: events.MouseUp) -> None:
        if self._dragging:
            self._dragging = False
            self.release_mouse()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        event.stop()
        self._turn(-1)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        event.stop()
        self._turn(1)
