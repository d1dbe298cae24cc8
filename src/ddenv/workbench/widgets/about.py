"""What is told of a world, in the few lines that there is room for."""

from __future__ import annotations

from rich.text import Text
from textual.widgets import Static

MORE = " …"


class About(Static):
    """A text of at most `max-height` lines; where it is longer, an ellipsis says so."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__("", id=id, markup=False)
        self._words = ""

    def tell(self, words: str) -> None:
        self._words = words
        self._fit()

    def on_resize(self) -> None:
        self._fit()

    def _fit(self) -> None:
        width, most = self.content_size.width, self.styles.max_height
        lines = Text(self._words).wrap(self.app.console, max(1, width))
        if most is None or len(lines) <= most.cells:
            self.update(Text(self._words))
            return
        *shown, last = (line.plain.rstrip() for line in lines[: most.cells])
        if len(last) + len(MORE) > width:
            last = last.rpartition(" ")[0]
        self.update(Text("\n".join([*shown, f"{last}{MORE}"])))
