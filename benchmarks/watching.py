"""Measures one workbench in a terminal: its first paint, its answers to keys, how much it writes."""

from __future__ import annotations

import random
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from screen import Screen
from terminal import SIZE, Terminal

DDENV = (sys.executable, "-c", "from ddenv.cli import main; main()")
# The map is in the left half, the table in the right one.
LEFT, RIGHT, ALL = slice(0, SIZE[0] // 2), slice(SIZE[0] // 2, SIZE[0]), slice(0, SIZE[0])
# Letters and digits on a screen that has really begun.
WORDS = 150
# The pause between two keys is this long, up to twice, s: so no key comes in step with anything else.
PAUSE = 0.08
NO_ANSWER = 1.0  # after so long, s


@dataclass(frozen=True)
class Key:
    """Two keys in turn; the second undoes the first. Their answer changes at least this many cells at once."""

    name: str
    keys: tuple[str, str]
    where: slice
    cells: int


# The same key in a bare Textual table, see bare.py.
BARE_KEY = Key("down in a bare table", ("\x1b[B", "\x1b[A"), ALL, 40)
KEYS = (
    Key("down in the table", ("\x1b[B", "\x1b[A"), RIGHT, 60),
    Key("+ on the map", ("+", "-"), LEFT, 120),
    Key("tab", ("\t", "\x1b[Z"), ALL, 60),
)


@dataclass(frozen=True)
class Starts:
    """Seconds to the first paint, to all of it, and of `import textual.app` beside them."""

    first: list[float]
    whole: list[float]
    bare: list[float]

    def __str__(self) -> str:
        first, whole, bare = (statistics.median(times) for times in (self.first, self.whole, self.bare))
        return f"{first:.2f} s = {first / bare:.1f} x {bare:.2f} s; all after {whole:.2f} s"


@dataclass(frozen=True)
class Answers:
    """Seconds from key to paint, of the answered keys."""

    seconds: list[float]
    pressed: int

    def __str__(self) -> str:
        if len(self.seconds) < 2:
            return f"{len(self.seconds)} of {self.pressed} answered"
        hundredths = statistics.quantiles(self.seconds, n=100, method="inclusive")
        parts = " / ".join(f"{1000 * hundredths[part - 1]:.0f}" for part in (50, 95, 99))
        return f"{parts} ms" + ("" if len(self.seconds) == self.pressed else f"; {self.missed} not answered")

    @property
    def missed(self) -> int:
        return self.pressed - len(self.seconds)


def starts(words: list[str], environment: dict[str, str], times: int) -> Starts:
    """Starts the workbench some times, on something that does not change, each time beside the bare import.

    One more start comes before, which compiles it.
    """
    first, whole, bare = [], [], []
    with attached(words, environment):
        pass
    for _ in range(times):
        begun = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import textual.app"], check=True, env=environment)
        bare.append(time.perf_counter() - begun)
        terminal = Terminal([*DDENV, *words], environment)
        try:
            first.append(_painted(terminal) - terminal.started)
            whole.append(terminal.settle(quiet=0.7, seconds=10.0) - terminal.started)
        finally:
            terminal.leave()
    return Starts(first, whole, bare)


@contextmanager
def attached(words: list[str], environment: dict[str, str], program: tuple[str, ...] = DDENV) -> Iterator[Terminal]:
    """A workbench whose screen is there and had time to read its world."""
    terminal = Terminal([*program, *words], environment)
    try:
        _painted(terminal)
        terminal.watch(2.0)
        yield terminal
    finally:
        terminal.leave()


def _painted(terminal: Terminal) -> float:
    at = terminal.until(lambda screen: screen.filled >= WORDS, 30.0)
    if at is None:
        raise TimeoutError("\n".join(["after 30 s there is only:", *terminal.screen.lines]))
    return at


def answers(terminal: Terminal, key: Key, times: int) -> Answers:
    """Presses a key and the one that undoes it in turn."""
    seconds = []
    for number in range(times):
        terminal.watch(random.uniform(PAUSE, 2 * PAUSE))
        took = _answer(terminal, key, key.keys[number % 2], NO_ANSWER)
        if took is not None:
            seconds.append(took)
    return Answers(seconds, times)


def by_itself(terminal: Terminal, key: Key, times: int, seconds: float) -> Answers:
    """How often the screen changes as much without a key."""
    changed = []
    for _ in range(times):
        terminal.watch(PAUSE)
        took = _answer(terminal, key, "", seconds)
        if took is not None:
            changed.append(took)
    return Answers(changed, times)


def _answer(terminal: Terminal, key: Key, press: str, seconds: float) -> float | None:
    before = terminal.screen.copy()

    def answered(screen: Screen) -> bool:
        return screen.changed(before, key.where) >= key.cells

    at = terminal.press(press) if press else time.perf_counter()
    seen = terminal.until(answered, seconds)
    return None if seen is None else seen - at


def rate(terminal: Terminal, seconds: float) -> tuple[float, int]:
    """Bytes written while no key is pressed: in a second on average, and the maximum in a second."""
    begun = time.perf_counter()
    terminal.watch(seconds)
    each = [0] * (int(seconds) + 1)
    for at, size in terminal.writes:
        if at >= begun:
            each[min(int(at - begun), int(seconds))] += size
    return sum(each) / seconds, max(each)
