"""The panel that shows what is happening: the current line of the algorithm, and sentences on it."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from rich.text import Text
from textual.widget import Widget

from ddenv.runfile.snapshot import Snapshot

if TYPE_CHECKING:
    from ddenv.words.explain import Explanation

# Minimum time between two updates within a round, s.
PERIOD = 1.0


class Happening(Widget):
    """Lines of the algorithm around the current one, as many as there is room for, above the sentences."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._explanation: Explanation | None = None
        self._snapshot: Snapshot | None = None
        self.trouble = ""
        self._urgent: tuple[object, ...] = ()
        self._shown_at = -math.inf
        self._first = 0

    def show(self, snapshot: Snapshot, trouble: str = "") -> None:
        """`trouble` comes first: what went wrong with the engine itself."""
        if snapshot is self._snapshot and trouble == self.trouble:
            return
        urgent, moment = _urgent(snapshot), time.monotonic()
        if urgent == self._urgent and trouble == self.trouble and moment - self._shown_at < PERIOD:
            # Tests follow each other faster than anybody reads: the next update shows the one that runs then.
            return
        # With this most of `words` is loaded: the screen is shown before.
        from ddenv.words.explain import explain

        self._snapshot, self._urgent, self._shown_at = snapshot, urgent, moment
        explanation = explain(snapshot)
        if (explanation, trouble) != (self._explanation, self.trouble):
            self._explanation, self.trouble = explanation, trouble
            self.refresh()

    def render(self) -> Text:
        if self._explanation is None:
            return Text()
        sentences = [Text(sentence) for sentence in self._explanation.sentences]
        if self.trouble:
            sentences.insert(0, Text(self.trouble, self.app.theme_variables["text-error"]))
        said, (width, height) = Text("\n").join(sentences), self.size
        room = height - len(said.wrap(self.app.console, max(1, width)))
        self._first = _scrolled(self._explanation, room, self._first)
        code = _window(self._explanation, width, room, self._first, self.app.theme_variables["primary"])
        return code.append_text(said)


def _urgent(snapshot: Snapshot) -> tuple[object, ...]:
    state = snapshot.state
    number = None if state.round is None else (state.round.number, state.round.done)
    return (
        snapshot.happened,
        snapshot.status,
        snapshot.error,
        state.paused,
        state.waiting_candidate,
        state.confirming,
        state.node,
        number,
    )


def _shown(explanation: Explanation, room: int) -> int:
    """How many lines of the algorithm there is room for: at least one, and a blank line below if it fits."""
    return max(1, min(room - 1, len(explanation.lines)))


def _index(explanation: Explanation) -> int:
    return next((place for place, (number, _) in enumerate(explanation.lines) if number == explanation.line), 0)


def _scrolled(explanation: Explanation, room: int, first: int) -> int:
    """The first line to show: the same as before, unless the current line or its neighbours would be out of sight."""
    shown, index = _shown(explanation, room), _index(explanation)
    beside = min(1, (shown - 1) // 2)
    first = min(max(first, index + beside + 1 - shown), index - beside)
    return max(0, min(first, len(explanation.lines) - shown))


def _window(explanation: Explanation, width: int, room: int, first: int, color: str) -> Text:
    text = Text()
    if explanation.line is None:
        return text
    index, shown = _index(explanation), _shown(explanation, room)
    for place in range(first, first + shown):
        number, code = explanation.lines[place]
        current = place == index
        row = Text(f"{'▶' if current else ' '}{number:>2} {code}", f"bold {color}" if current else "dim", no_wrap=True)
        row.truncate(width, overflow="ellipsis")
        text.append_text(row).append("\n")
    return text.append("\n") if room - shown >= 1 and shown > 1 else text
