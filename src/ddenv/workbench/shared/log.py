"""The log of a run as lines with their times, and its decisions."""

from __future__ import annotations

import time
from bisect import bisect_right
from dataclasses import dataclass
from textwrap import wrap

from rich.text import Text

from ddenv.runfile.progress import Decision
from ddenv.runfile.state import RunState
from ddenv.text import plain

# Where the words begin, after the time.
BEGIN = " " * 10
NOTHING_DECIDED = "you decided nothing yet"


@dataclass(frozen=True, slots=True)
class Entry:
    """`event` is the id of its event, `time` is Unix time, s."""

    event: int
    time: float
    words: str


class Log:
    """What happened, from a run's events as they come."""

    def __init__(self) -> None:
        self._entries: list[Entry] = []

    def until(self, event: int | None) -> list[Entry]:
        """The entries of an event and of all before it; all there are for None."""
        found = self._entries
        if event is None:
            return found[:]
        return found[: bisect_right(found, event, key=lambda entry: entry.event)]

    def add(self, kind: str, before: RunState, after: RunState) -> None:
        from ddenv.words.news import news

        try:
            words = news(kind, before, after, attached=True)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError):
            # A damaged scenario has no words; the screen shows elsewhere what is wrong.
            words = ""
        if words:
            self._entries.append(Entry(after.revision, after.updated_at, words))

    @staticmethod
    def parts(entry: Entry, width: int) -> list[Text]:
        """An entry with its time of day, in lines that fit; what belongs to the line before stays
        indented.
        """
        return _in_lines(entry.time, entry.words, width, "  ")


def as_it_is(text: Text, _: int) -> Text:
    return text.copy()


def decision_lines(decision: Decision, width: int) -> list[Text]:
    return _in_lines(decision.time, decision.words, width)


def _in_lines(at: float, words: str, width: int, hanging: str = "") -> list[Text]:
    indent = " " * (len(words) - len(words.lstrip()))
    first, *more = wrap(plain(words), max(12, width - len(BEGIN) - len(indent) - len(hanging))) or [
        ""
    ]
    line = Text(time.strftime("%H:%M:%S", time.localtime(at)), "dim", no_wrap=True)
    line.append(f"  {indent}{first}", "not dim")
    return [line, *(Text(f"{BEGIN}{indent}{hanging}{each}", no_wrap=True) for each in more)]
