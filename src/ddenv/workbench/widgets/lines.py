"""A long list of lines: only visible ones are made."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rich.segment import Segment
from rich.text import Text
from textual import events
from textual.geometry import Size
from textual.scroll_view import ScrollView
from textual.strip import Strip


class Lines(ScrollView, can_focus=True):
    """One line for each item, made by `line(item, width)` when it becomes visible. With `tail` the
    last ones are shown.

    With `parts` an item takes several lines: `parts(item, width)` are what `line` is called with.
    """

    def __init__(
        self,
        line: Callable[[Any, int], Text],
        *,
        nothing: str = "",
        tail: bool = False,
        parts: Callable[[Any, int], Sequence[Any]] | None = None,
        clicked: Callable[[Any], object] = lambda _: None,
        id: str | None = None,
    ) -> None:
        """`nothing` is shown when there are no items; `clicked` is called with what a line shows
        that was clicked.
        """
        super().__init__(id=id)
        self._line = line
        self._nothing = nothing
        self._tail = tail
        self._parts = parts
        self._clicked = clicked
        self.items: Sequence[Any] = ()
        # What each line is made of, and how many columns the items were taken apart for.
        self._rows: Sequence[Any] = ()
        self._columns = 0

    def show(self, items: Sequence[Any]) -> None:
        at_end = self.scroll_offset.y >= self.max_scroll_y
        before = self.items
        self.items = items
        if not self.size.width:
            # Not visible: the screen needs no new layout for each line.
            self._columns = 0
            return
        self._take_apart(before)
        self.virtual_size = Size(0, len(self._rows))
        if self._tail and at_end and self.is_attached:
            # Forced: the first line that does not fit has no scroll bar yet.
            self.scroll_end(animate=False, immediate=True, force=True)
        self.refresh()

    def _take_apart(self, before: Sequence[Any]) -> None:
        """Makes the rows; only those of new items where the ones `before` are still the first."""
        if self._parts is None:
            self._rows = self.items
            return
        # The scroll bar may come and go.
        columns = max(1, self.size.width - self.styles.scrollbar_size_vertical)
        known = len(before)
        goes_on = columns == self._columns and known <= len(self.items) and known > 0
        goes_on = goes_on and before[0] is self.items[0] and before[-1] is self.items[known - 1]
        new = self.items[known:] if goes_on else self.items
        rows = [row for item in new for row in self._parts(item, columns)]
        self._rows = [*self._rows, *rows] if goes_on else rows
        self._columns = columns

    def on_resize(self) -> None:
        self._take_apart(())
        self.virtual_size = Size(0, len(self._rows))
        if self._tail:
            self.scroll_end(animate=False, force=True)

    def watch_show_vertical_scrollbar(self) -> None:
        # A new scroll bar does not have the position of the list yet.
        self.vertical_scrollbar.position = self.scroll_y

    def on_click(self, event: events.Click) -> None:
        place = int(event.y + self.scroll_offset.y)
        if 0 <= place < len(self._rows):
            self._clicked(self._rows[place])

    def render_line(self, y: int) -> Strip:
        width = self.scrollable_content_region.width
        base = self.rich_style
        place = y + self.scroll_offset.y
        if 0 <= place < len(self._rows):
            text = self._line(self._rows[place], width)
        elif place == 0:
            text = Text(self._nothing, "dim")
        else:
            return Strip.blank(width, base)
        text.truncate(width, overflow="ellipsis")
        segments = list(text.render(self.app.console))
        strip = Strip(Segment.apply_style(segments, base))
        return strip.adjust_cell_length(width, base)
