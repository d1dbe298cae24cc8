"""The lines below the map: what is selected and shown on it, and what the signs mean."""

from __future__ import annotations

from rich.text import Text
from textual.widget import Widget

from ddenv.runfile.guiding import Trial
from ddenv.runfile.state import Candidate
from ddenv.workbench.widgets.map import WorldMap
from ddenv.workbench.wording import count


class MapLines(Widget):
    """One line on what is shown, one of signs; drawn again only if they changed. The map itself tells what its crosshair is on."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._map: WorldMap | None = None
        self._shown: Candidate | Trial | None = None
        self._drawn: tuple = ()

    def show(self, world: WorldMap, shown: Candidate | Trial | None) -> None:
        """`shown` is the candidate or trial whose models stand out."""
        self._map, self._shown = world, shown
        facts = (world.selection, None if shown is None else (shown.label, shown.size), world.legend(200).plain)
        if facts != self._drawn:
            self._drawn = facts
            self.refresh()

    def render(self) -> Text:
        if self._map is None:
            return Text("")
        width = self.size.width
        first = self._about(self._map, width)
        first.truncate(width, overflow="ellipsis")
        return first.append("\n").append_text(self._map.legend(width))

    def _about(self, world: WorldMap, width: int) -> Text:
        text = Text(no_wrap=True)
        if world.selection:
            keys = ": p pin, w try without, o try only" if width > 44 else ": p, w or o"
            text.append(f"{len(world.selection)} selected", "bold").append(keys, "dim")
        elif self._shown is not None:
            text.append(f"{self._shown.label}: {count(self._shown.size, 'model')}", "bold")
            text.append("  others in small letters" if width > 44 else "", "dim")
        return text
