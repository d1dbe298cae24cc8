"""The time within a test as a slider: a line for each test, with the instant, its end, first touches, and when two part."""

from __future__ import annotations

from dataclasses import dataclass

from rich.text import Text
from textual import events
from textual.message import Message
from textual.widget import Widget

from ddenv.runfile.state import Test
from ddenv.words.signs import outcome
from ddenv.workbench.map.map_words import PARTING

GONE, COMING, NOW, END, TOUCH = "━", "─", "●", "┤", "▾"
ROBOTS = "→⇒"
# The width of the sign before a line, and the greatest of the words after it.
SIGN, WORDS = 2, 24


@dataclass(frozen=True, slots=True)
class Instant:
    """What the slider shows: simulated `time` of `length`, s; the `tests`, how long each lasted, and when they part, if so."""

    time: float = 0.0
    length: float = 0.0
    tests: tuple[Test, ...] = ()
    lengths: tuple[float, ...] = ()
    parting: float | None = None


class Timeline(Widget):
    """Click or drag to an instant; the wheel goes from frame to frame."""

    ALLOW_SELECT = False
    DEFAULT_CSS = "Timeline { height: auto; }"

    @dataclass
    class Moved(Message):
        """The user wants to be at simulated `seconds`."""

        seconds: float

    @dataclass
    class Turned(Message):
        """The user turned the wheel by so many `frames`."""

        frames: int

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.shown = Instant()
        self._dragging = False

    def show(self, shown: Instant) -> None:
        if shown != self.shown:
            taller = len(shown.tests) != len(self.shown.tests)
            self.shown = shown
            self.refresh(layout=taller)

    def render(self) -> Text:
        lines = [self._line(number, test) for number, test in enumerate(self.shown.tests)]
        return Text("\n", no_wrap=True).join(lines)

    @property
    def _words(self) -> int:
        return min(WORDS, max((len(outcome(test)) for test in self.shown.tests), default=0), self.size.width // 3)

    @property
    def _room(self) -> int:
        return max(2, self.size.width - SIGN - self._words - 1)

    def _cell(self, time: float) -> int:
        part = time / self.shown.length if self.shown.length > 0 else 0.0
        return min(self._room - 1, max(0, round(part * (self._room - 1))))

    def _line(self, number: int, test: Test) -> Text:
        shown, last, now = self.shown, self._cell(self.shown.lengths[number]), self._cell(self.shown.time)
        cells = [GONE if cell < now else COMING for cell in range(last + 1)] + [" "] * (self._room - 1 - last)
        for _, at in test.first_touched:
            if at <= shown.lengths[number]:
                cells[self._cell(at)] = TOUCH
        cells[last] = END
        if shown.parting is not None:
            cells[self._cell(shown.parting)] = PARTING
        cells[now] = NOW
        text = Text(f"{ROBOTS[number]} ", "bold", no_wrap=True).append("".join(cells), "not bold")
        text.stylize("bold", SIGN, SIGN + now + 1)
        return text.append(f" {outcome(test)[: self._words]}", "not bold")

    def _time(self, x: int) -> float:
        return max(0.0, min(1.0, (x - SIGN) / (self._room - 1))) * self.shown.length

    def on_mouse_down(self, event: events.MouseDown) -> None:
        if event.button == 1 and SIGN <= event.x < SIGN + self._room:
            self._dragging = True
            self.capture_mouse()
            self.post_message(self.Moved(self._time(event.x)))

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._dragging:
            self.post_message(self.Moved(self._time(event.x)))

    def on_mouse_up(self, event: events.MouseUp) -> None:
        if self._dragging:
            self._dragging = False
            self.release_mouse()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        event.stop()
        self.post_message(self.Turned(-1))

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        event.stop()
        self.post_message(self.Turned(1))
