"""The variables of the algorithm with their values now; those that just changed are marked."""

from __future__ import annotations

from rich.text import Text
from textual.widget import Widget

from ddenv.learn.variables import Variable
from ddenv.text import plain, truncated

CHANGED = "▸"
WIDTH = 15


class Variables(Widget):
    """A line each; the longest values take two where there is room."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._variables: tuple[Variable, ...] = ()

    def show(self, variables: tuple[Variable, ...]) -> None:
        """Other values."""
        if variables != self._variables:
            self._variables = variables
            self.refresh()

    def render(self) -> Text:
        width, height = self.size
        room = max(8, width - WIDTH - 3)
        spare = height - len(self._variables)
        text = Text(no_wrap=True)
        for one in self._variables:
            value = plain(one.value) or "–"
            rows = 1 + (spare > 0 and len(value) > room)
            spare -= rows - 1
            style = "bold" if one.changed else ""
            text.append(f"{CHANGED if one.changed else ' '} {one.name:<{WIDTH}} ", style or "dim")
            text.append("\n".join(_cut(value, room, rows)), style).append("\n")
        return text


def _cut(value: str, room: int, rows: int) -> list[str]:
    """At most two lines; the second is indented."""
    if rows == 1 or len(value) <= room:
        return [truncated(value, room)]
    cut = value.rfind(" ", 0, room + 1)
    cut = cut if cut > 0 else room
    return [value[:cut].rstrip(), " " * (WIDTH + 3) + truncated(value[cut:].strip(), room)]
