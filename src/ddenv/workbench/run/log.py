"""The log of a run as lines with their times, and its decisions."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass

from rich.text import Text

from ddenv.runfile.state import Decision, RunState
from ddenv.words import news
from ddenv.workbench.wording import plain

# Maximum number of lines; the oldest go first.
MOST = 2000
NOTHING_DECIDED = "you decided nothing yet"


@dataclass(frozen=True, slots=True)
class Entry:
    """`time` is Unix time, s."""

    time: float
    words: str


class Log:
    """What happened, from a run's events as they come."""

    def __init__(self) -> None:
        self._entries: deque[Entry] = deque(maxlen=MOST)
        self._revision = 0
        self._changed = False

    @property
    def entries(self) -> tuple[Entry, ...]:
        return tuple(self._entries)

    def changed(self) -> bool:
        """Whether there is anything new since the last call."""
        changed, self._changed = self._changed, False
        return changed

    def add(self, kind: str, before: RunState, after: RunState) -> None:
        """One more event; the same event again changes nothing."""
        if after.revision <= self._revision:
            return
        self._revision = after.revision
        try:
            words = news(kind, before, after, attached=True)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError):
            # A damaged scenario has no words; the screen shows elsewhere what is wrong.
            words = ""
        if words:
            self._entries.append(Entry(after.updated_at, words))
            self._changed = True

    @staticmethod
    def line(entry: Entry, width: int) -> Text:
        """An entry with its time of day; what belongs to the line before stays indented."""
        indent = " " * (len(entry.words) - len(entry.words.lstrip()))
        return _timed(entry.time, f"{indent}{plain(entry.words)}")


def decision_line(decision: Decision, width: int) -> Text:
    """A decision with its time of day."""
    return _timed(decision.time, plain(decision.words))


def _timed(at: float, words: str) -> Text:
    text = Text(time.strftime("%H:%M:%S", time.localtime(at)), "dim", no_wrap=True)
    return text.append(f"  {words}", "not dim")
