"""What is happening: where in its algorithm the run is, and what it does there and why."""

from __future__ import annotations

from rich.text import Text
from textual.widget import Widget

from ddenv.workbench.explain import Explanation, explain
from ddenv.workbench.listings import Lines
from ddenv.workbench.poll import Snapshot


class Happening(Widget):
    """Lines of the algorithm around the current one, as many as there is room for, above the sentences."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._explanation = Explanation(None, ())
        self._snapshot: Snapshot | None = None
        self.trouble = ""

    def show(self, snapshot: Snapshot, trouble: str = "") -> None:
        """`trouble` comes first: what went wrong with the engine itself."""
        if snapshot is self._snapshot and trouble == self.trouble:
            return
        self._snapshot = snapshot
        explanation = explain(snapshot)
        if (explanation, trouble) != (self._explanation, self.trouble):
            self._explanation, self.trouble = explanation, trouble
            self.refresh()

    def render(self) -> Text:
        width, height = self.size
        words = self._sentences()
        taken = len(words.wrap(self.app.console, max(1, width)))
        text = _window(self._explanation, width, height - taken, self.app.theme_variables["primary"])
        return text.append_text(words)

    def _sentences(self) -> Text:
        sentences = [Text(sentence) for sentence in self._explanation.sentences]
        if self.trouble:
            sentences.insert(0, Text(self.trouble, self.app.theme_variables["text-error"]))
        return Text("\n").join(sentences)


def _window(explanation: Explanation, width: int, room: int, color: str) -> Text:
    """Up to `room` lines of the algorithm with the current one marked; at least that one, and a blank line below if it fits."""
    text = Text()
    lines: Lines = explanation.lines
    if explanation.line is None:
        return text
    index = next((place for place, (number, _) in enumerate(lines) if number == explanation.line), 0)
    shown = max(1, min(room - 1, len(lines)))
    first = max(0, min(index - shown // 2, len(lines) - shown))
    for place in range(first, first + shown):
        number, code = lines[place]
        current = place == index
        row = Text(f"{'▶' if current else ' '}{number:>2} {code}", f"bold {color}" if current else "dim", no_wrap=True)
        row.truncate(width, overflow="ellipsis")
        text.append_text(row).append("\n")
    return text.append("\n") if room - shown >= 1 and shown > 1 else text
