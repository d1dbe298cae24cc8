"""The map of a run: the world from above, where a crosshair, keys and the mouse point at models and places."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual.binding import Binding
from textual.message import Message
from textual.widget import Widget

from ddenv.map.cells import Cell
from ddenv.map.raster import EMPTY, View
from ddenv.runfile.state import Candidate, Trial
from ddenv.workbench.map.described import describe
from ddenv.workbench.map.overview import LAYERS, Overview, Place
from ddenv.workbench.run.poll import Snapshot
from ddenv.workbench.wording import count, plain

if TYPE_CHECKING:
    from ddenv.runfile.state import Trial

__all__ = ["LAYERS", "Place", "WorldMap"]


class WorldMap(Overview, can_focus=True):
    """Top-down map. Give it a `Place`, then snapshots. While it is `picking`, enter and clicks choose places, not models."""

    HELP = "click: select a model or not   wheel: closer, farther   drag: move the map"
    BINDINGS: ClassVar = [
        Binding("left", "move(-1, 0)", "move", show=False, id="map.left", tooltip="crosshair to the left"),
        Binding("right", "move(1, 0)", "move", show=False, id="map.right", tooltip="crosshair to the right"),
        Binding("up", "move(0, 1)", "move", show=False, id="map.up", tooltip="crosshair up"),
        Binding("down", "move(0, -1)", "move", show=False, id="map.down", tooltip="crosshair down"),
        Binding("shift+left", "pan(-1, 0)", "pan", show=False, id="map.pan_left", tooltip="move the map to the left"),
        Binding("shift+right", "pan(1, 0)", "pan", show=False, id="map.pan_right", tooltip="move the map to the right"),
        Binding("shift+up", "pan(0, 1)", "pan", show=False, id="map.pan_up", tooltip="move the map up"),
        Binding("shift+down", "pan(0, -1)", "pan", show=False, id="map.pan_down", tooltip="move the map down"),
        Binding("enter", "pick", "select", id="map.pick", tooltip="select the model under the crosshair, or no longer"),
        Binding(
            "left_square_bracket",
            "neighbour(-1)",
            "previous model",
            show=False,
            id="map.previous",
            key_display="[",
            tooltip="crosshair to the previous model",
        ),
        Binding(
            "right_square_bracket",
            "neighbour(1)",
            "next model",
            show=False,
            id="map.next",
            key_display="]",
            tooltip="crosshair to the next model",
        ),
    ]

    @dataclass
    class Pointed(Message):
        """The crosshair is on another model, or on none."""

        model: str | None

    @dataclass
    class SelectionChanged(Message):
        """Other models are selected by hand."""

        models: frozenset[str]

    @dataclass
    class PlacePicked(Message):
        """A place was chosen, m."""

        x: float
        y: float

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._picking = False
        self._numbers: dict[str, int] = {}
        # The model that the crosshair was sent to, with where it was then: it may be hidden by another one.
        self._aim: tuple[str, Cell, View] | None = None
        self._pointed: str | None = None
        self._told: tuple = ()

    @property
    def picking(self) -> bool:
        """Whether enter and clicks choose places."""
        return self._picking

    @picking.setter
    def picking(self, picking: bool) -> None:
        self._picking = picking
        self.draw()

    @property
    def aims(self) -> bool:
        return self.has_focus or self._picking

    def set_place(self, place: Place, notice: str = "") -> None:
        self._numbers = {each.name: number for number, each in enumerate(place.prints)}
        self._aim = None
        super().set_place(place, notice)

    def show(self, snapshot: Snapshot, candidate: Candidate | Trial | None) -> None:
        if self.selection and snapshot.state.environment is not self.snapshot.state.environment:
            self.select(self.selection.intersection(snapshot.state.environment))
        super().show(snapshot, candidate)

    # Models.

    @property
    def model_at_cursor(self) -> str | None:
        """The name of the model under the crosshair."""
        if self._aim is not None and self._aim[1:] == (self.cursor, self._view):
            return self._aim[0]
        drawn = self._picture
        if drawn is None or not drawn.holds(self.cursor):
            return None
        owner = drawn.owner(self.cursor)
        return None if owner == EMPTY else self.place.prints[owner].name

    def describe(self, name: str, columns: int = 0) -> Text:
        """What is known of a model, on one line of at most so many `columns`; empty for one that is not there."""
        number = self._numbers.get(name)
        return Text() if number is None else describe(self.snapshot.state, self.place.prints[number], columns)

    def go_to(self, name: str) -> bool:
        """The crosshair to a model, and the map to where it is; False if there is no such model."""
        number, view = self._numbers.get(name), self._view
        if number is None or view is None:
            return False
        center = self.place.prints[number].center
        current = self._picture is not None and self._seen is not None and self._seen.view == view
        cell = (self._picture.cells.get(number) if current else None) or view.cell(*center)
        if cell is None:
            self._fitted = False
            self._view = view.around(*center)
            cell = self._view.cell(*center)
        self.cursor = cell or self.cursor
        self._aim = (name, self.cursor, self._view)
        self.draw()
        return True

    def select(self, names: Iterable[str]) -> None:
        """These models instead of those selected so far."""
        selection = frozenset(names)
        if selection != self.selection:
            self.selection = selection
            self.post_message(self.SelectionChanged(selection))
            self.draw()

    def clear_selection(self) -> None:
        """No model is selected any more."""
        self.select(())

    def action_neighbour(self, step: int) -> None:
        """The model before or after the one under the crosshair, in the order of the world."""
        state = self.snapshot.state
        left = frozenset(state.environment)
        names = [name for name in state.elements if name in left] or list(self._numbers)
        here = self.model_at_cursor
        if here in names:
            self.go_to(names[(names.index(here) + step) % len(names)])
        elif names:
            self.go_to(names[0 if step > 0 else -1])

    def clicked(self) -> None:
        self._aim = None
        self.action_pick()

    def action_pick(self) -> None:
        """Chooses the place under the crosshair, or else its model."""
        name, state = self.model_at_cursor, self.snapshot.state
        if self._picking and self._view is not None:
            self.post_message(self.PlacePicked(*(round(value, 3) for value in self._view.point(self.cursor))))
        elif name is None or not state.elements:
            return
        elif name in state.environment:
            self.select(self.selection ^ {name})
        else:
            why = "removed already" if name in state.elements else "protected: it always stays"
            self.notify(f"{plain(name)} is {why}", severity="warning", markup=False)

    # What is told of them.

    def draw(self) -> None:
        super().draw()
        if self._view is not None and self.is_attached:
            self._tell_pointed()

    def _tell_pointed(self) -> None:
        """The model under the crosshair in the panel's lower border, else how wide the map is."""
        model = self.model_at_cursor if self.aims else None
        if model != self._pointed:
            self._pointed = model
            self.post_message(self.Pointed(model))
        # Words take their time: only when something of what they tell changed.
        place = self.cursor if self._picking else self.snapshot.state.evidence_test
        told = (model, self._who[1], self._view, place, self.notice)
        if told != self._told:
            self._told = told
            if isinstance(self.parent, Widget):
                self.parent.border_subtitle = self._words(model)

    def _words(self, model: str | None) -> Text:
        if self._picking:
            x, y = self._view.point(self.cursor)
            return Text(f"x {x:.2f}, y {y:.2f} m")
        if model is not None:
            return self.describe(model, self.size.width - 4)
        if not self.place.prints:
            return Text("" if self.notice else "this world has no models")
        return Text(f"{self._view.columns * self._view.scale:.3g} m wide")


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
