"""An input that shows its text from the beginning: a number without its sign or its first digit
would be another number.
"""

from __future__ import annotations

from rich.cells import cell_len
from rich.segment import Segment
from textual.strip import Strip
from textual.widgets import Input
from textual.widgets.input import Selection


class Entry(Input):
    """Text that does not fit ends with an ellipsis, unless it is being edited."""

    def __init__(self, value: str = "", *, id: str, placeholder: str = "") -> None:
        super().__init__(value, id=id, placeholder=placeholder, compact=True, select_on_focus=False)

    def on_mount(self) -> None:
        self.cursor_position = 0

    def on_focus(self) -> None:
        """Selects all, so that typing replaces it; the cursor is at the beginning."""
        self.selection = Selection(len(self.value), 0)

    def on_blur(self) -> None:
        self.cursor_position = 0

    def watch_value(self) -> None:
        # With its first text, an input puts its cursor at the end.
        if not self.has_focus:
            self.cursor_position = 0

    def render_line(self, y: int) -> Strip:
        strip = super().render_line(y)
        width = self.content_size.width
        if y or self.has_focus or cell_len(self.value) <= width:
            return strip
        return Strip.join([strip.crop(0, width - 1), Strip([Segment("…", self.rich_style)])])
