"""The panel that shows what is happening: the current line of the algorithm, and sentences on
it.
"""

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
    """Lines of the algorithm around the current one, as many as there is room for, above the
    sentences.
    """

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._explanation: Explanation | None = None
        self._urgent: tuple[object, ...] = ()
        self._shown_at = -math.inf
        self._first = 0

    def show(self, snapshot: Snapshot, trouble: str = "") -> None:
        """`trouble` comes first: what went wrong with the engine itself."""
        state = snapshot.state
        moment = time.monotonic()
        round = None if state.round is None else (state.round.number, state.round.done)
        decided = state.paused, state.waiting_candidate, state.confirming, state.node, round
        urgent = trouble, snapshot.happened, snapshot.status, snapshot.error, *decided
        if urgent == self._urgent and moment - self._shown_at < PERIOD:
            # Tests follow each other faster than anybody reads: the next update shows the one that
            # runs then.
            return
        # With this most of `words` is loaded: the screen is shown before.
        from ddenv.words.explain import explain

        before = (self._urgent[:1], self._explanation)
        self._explanation = explain(snapshot)
        self._urgent = urgent
        self._shown_at = moment
        if before != ((trouble,), self._explanation):
            self.refresh()

    def render(self) -> Text:
        if self._explanation is None:
            return Text()
        (width, height) = self.size
        lines = self._explanation.lines
        current = self._explanation.line
        sentences = [Text(sentence) for sentence in self._explanation.sentences]
        if trouble := self._urgent[0]:
            sentences.insert(0, Text(str(trouble), self.app.theme_variables["text-error"]))
        text = Text()
        said = Text("\n").join(sentences)
        if current is None:
            return said
        room = height - len(said.wrap(self.app.console, max(1, width)))
        # At least one line, and a blank one below if it fits.
        shown = max(1, min(room - 1, len(lines)))
        index = next((place for place, (number, _) in enumerate(lines) if number == current), 0)
        # The first one stays, unless the current one or its neighbours would be out of sight.
        beside = min(1, (shown - 1) // 2)
        first = min(max(self._first, index + beside + 1 - shown), index - beside)
        self._first = max(0, min(first, len(lines) - shown))
        for number, code in lines[self._first : self._first + shown]:
            mark, style = (
                ("▶", f"bold {self.app.theme_variables['primary']}")
                if number == current
                else (" ", "dim")
            )
            row = Text(f"{mark}{number:>2} {code}", style, no_wrap=True)
            row.truncate(width, overflow="ellipsis")
            text.append_text(row).append("\n")
        return text.append("\n" if room > shown > 1 else "").append_text(said)
