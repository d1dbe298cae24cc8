"""The map of a run: the world from above, with a crosshair to choose models and places by keys or
mouse.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from rich.segment import Segment
from rich.text import Text
from textual import events
from textual.geometry import Region
from textual.message import Message
from textual.reactive import var
from textual.strip import Strip
from textual.widget import Widget

from ddenv.runfile.snapshot import Snapshot
from ddenv.text import plain
from ddenv.workbench.map.map_colors import Palette, palette_of
from ddenv.workbench.map.map_words import describe
from ddenv.workbench.map.place import Limits, Place, Shown, Way
from ddenv.workbench.shared.bindings import keys
from ddenv.world.pose import Point, Vector

# What needs NumPy is loaded with the first world: the first paint of a run comes before.
if TYPE_CHECKING:
    from ddenv.map.cells import Cell
    from ddenv.map.footprints import Footprint
    from ddenv.map.paint import Canvas
    from ddenv.map.raster import View
    from ddenv.runfile.state import Candidate, Trial
    from ddenv.workbench.map.map_drawing import MapDrawing, Picture

# One step of the wheel zooms by this factor.
WHEEL = 1.25


class WorldMap(Widget, can_focus=True):
    """Top-down map. It takes a `Place`, then snapshots. While `picking`, enter and clicks choose
    places, not models.
    """

    # Whether enter and clicks choose places.
    picking = var(False)
    HELP = "click: select or unselect a model   wheel: zoom   drag: move the map"
    BINDINGS: ClassVar = keys(
        "map",
        ("left", "left", "move(-1, 0)", "", "crosshair to the left"),
        ("right", "right", "move(1, 0)", "", "crosshair to the right"),
        ("up", "up", "move(0, 1)", "", "crosshair up"),
        ("down", "down", "move(0, -1)", "", "crosshair down"),
        ("pan_left", "shift+left", "pan(-1, 0)", "", "move the map to the left"),
        ("pan_right", "shift+right", "pan(1, 0)", "", "move the map to the right"),
        ("pan_up", "shift+up", "pan(0, 1)", "", "move the map up"),
        ("pan_down", "shift+down", "pan(0, -1)", "", "move the map down"),
        ("pick", "enter", "pick", "select", "select or unselect the model under the crosshair"),
        ("previous", "[", "neighbour(-1)", "", "to the previous model"),
        ("next", "]", "neighbour(1)", "next model", "to the next model"),
    )

    @dataclass
    class Pointed(Message):
        """The crosshair is on another model, or on none."""

        model: str | None

    @dataclass
    class SelectionChanged(Message):
        """The selection changed."""

        models: frozenset[str]

    @dataclass
    class PlacePicked(Message):
        """A place was chosen, m."""

        x: float
        y: float

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.shown = Shown()
        self.notice = "reading the world ..."
        self.viewport = Viewport()
        self._palette: Palette | None = None
        self.picture: Picture | None = None
        self._canvas: Canvas | None = None
        self._strips: dict[int, Strip] = {}
        self._due = False
        # What the map showed before it marked a model.
        self._unmarked: Viewport | None = None
        # Where the mouse button went down on the map, and whether the mouse has moved since.
        self._grabbed: tuple[int, int] | None = None
        self._dragged = False
        self._numbers: dict[str, int] = {}
        # The model that the crosshair moved to, and the position: another model may hide it.
        self._aim: tuple[str, Cell, View] | None = None
        self._pointed: str | None = None
        self._subtitle_shown: Text | None = None

    @cached_property
    def _drawing(self) -> MapDrawing:
        from ddenv.workbench.map.map_drawing import MapDrawing

        return MapDrawing()

    @property
    def place(self) -> Place:
        return self.shown.place

    @property
    def snapshot(self) -> Snapshot:
        return self.shown.snapshot

    @property
    def selection(self) -> frozenset[str]:
        return self.shown.selection

    def watch_picking(self) -> None:
        self.draw()

    @property
    def aims(self) -> bool:
        return self.has_focus or self.picking or self._unmarked is not None

    def set_place(self, place: Place, notice: str = "") -> None:
        """Shows another world, or `notice` if there is none."""
        self.notice = notice
        self.shown = replace(self.shown, place=place)
        self._numbers = {each.name: number for number, each in enumerate(place.prints)}
        self._aim = None
        self.picture = None
        self._canvas = None
        self._subtitle_shown = None
        self.fit()
        self.refresh()

    def set_marks(self, spawn: Vector | None, goal: Point | None) -> None:
        self.shown = replace(self.shown, place=replace(self.place, spawn=spawn, goal=goal))
        self._refit()

    def show(self, snapshot: Snapshot, candidate: Candidate | Trial | None) -> None:
        before = self.snapshot
        if self.selection and snapshot.state.environment is not before.state.environment:
            self.select(self.selection.intersection(snapshot.state.environment))
        self.shown = replace(self.shown, snapshot=snapshot, candidate=candidate)
        if self._has_world:
            self._drawing.follow(snapshot)
        if snapshot.evidence is not before.evidence and self.viewport.fitted:
            self._refit()
        else:
            self.draw()

    def show_ways(
        self,
        ways: tuple[Way, ...],
        parting: Point | None,
        apart: tuple[str, str] | None,
        prints: tuple[Footprint, ...],
    ) -> None:
        """Shows finished tests in place of the run's own paths (see `Shown`), and the models at
        `prints`.
        """
        known = [way.points for way in self.shown.ways]
        place = self.place if prints is self.place.prints else replace(self.place, prints=prints)
        self.shown = replace(self.shown, place=place, ways=ways, parting=parting, apart=apart)
        same = len(known) == len(ways) and all(
            way.points is old for way, old in zip(ways, known, strict=True)
        )
        self.draw() if same or not self.viewport.fitted else self._refit()

    def show_limits(self, limits: Limits) -> None:
        self.shown = replace(self.shown, limits=limits)
        self.draw()

    def toggle_layer(self, name: str) -> None:
        self.shown = replace(self.shown, layers=self.shown.layers ^ {name})
        self.draw()

    @property
    def model_at_cursor(self) -> str | None:
        cursor = self.viewport.cursor
        if self._aim is not None and self._aim[1:] == (cursor, self.viewport.view):
            return self._aim[0]
        if self.picture is None or not self.picture.holds(cursor):
            return None
        owner = self.picture.owner(cursor)
        if owner is None:
            return None
        return self.place.prints[owner].name

    def describe(self, name: str, columns: int = 0) -> Text:
        number = self._numbers.get(name)
        if number is None:
            return Text()
        return describe(self.snapshot.state, self.place.prints[number], columns)

    def go_to(self, name: str) -> bool:
        number = self._numbers.get(name)
        port = self.viewport
        if number is None or port.view is None:
            return False
        drawn = self.picture
        sign = drawn.cells.get(number) if drawn is not None and drawn.view == port.view else None
        self.aim_at(*self.place.prints[number].center)
        port.cursor = sign or port.cursor
        self._aim = (name, port.cursor, port.view)
        self.draw()
        return True

    def aim_at(self, x: float, y: float) -> None:
        port = self.viewport
        cell = None if port.view is None else port.view.cell(x, y)
        if cell is None:
            port.center_on(x, y)
        else:
            port.cursor = cell
        self._aim = None
        self.draw()

    def mark(self, name: str | None) -> None:
        """Shows the crosshair on a model also without the focus; with None the map is again as it
        was.
        """
        if name is not None:
            self._unmarked = self._unmarked or copy(self.viewport)
            self.go_to(name)
        elif self._unmarked is not None:
            self.viewport = self._unmarked
            self._unmarked = None
            self._aim = None
            self.draw()

    def select(self, names: Iterable[str]) -> None:
        selection = frozenset(names)
        if selection != self.selection:
            self.shown = replace(self.shown, selection=selection)
            self.post_message(self.SelectionChanged(selection))
            self.draw()

    def action_neighbour(self, step: int) -> None:
        state = self.snapshot.state
        left = frozenset(state.environment)
        names = [name for name in state.elements if name in left] or list(self._numbers)
        here = self.model_at_cursor
        if here in names:
            self.go_to(names[(names.index(here) + step) % len(names)])
        elif names:
            self.go_to(names[0 if step > 0 else -1])

    def action_pick(self) -> None:
        """While picking, chooses the place under the crosshair; otherwise selects its model."""
        name = self.model_at_cursor
        state = self.snapshot.state
        port = self.viewport
        if self.picking and port.view is not None:
            self.post_message(
                self.PlacePicked(*(round(value, 3) for value in port.view.point(port.cursor)))
            )
        elif name is None or not state.elements or self.shown.ways:
            return
        elif name in state.environment:
            self.select(self.selection ^ {name})
        else:
            why = "removed already" if name in state.elements else "protected: it always stays"
            self.notify(f"{plain(name)} is {why}", severity="warning", markup=False)

    def zoom(self, factor: float) -> None:
        self.viewport.zoom(factor, self.viewport.cursor if self.aims else None)
        self._draw_soon()

    def fit(self) -> None:
        self.viewport.fitted = True
        self._refit()

    def _refit(self) -> None:
        columns, rows = self.size
        if columns and rows and self._has_world:
            self.viewport.resize(
                columns, rows, lambda *size: self._drawing.fitting(self.shown, *size)
            )
            self.draw()

    @property
    def _has_world(self) -> bool:
        return not self.notice or bool(self.place.prints)

    def on_resize(self) -> None:
        self._refit()

    def action_pan(self, right: int, up: int) -> None:
        self.viewport.pan_part(right, up)
        self._draw_soon()

    def action_move(self, right: int, up: int) -> None:
        self.viewport.step(right, up)
        self._draw_soon()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        self._wheel(event, WHEEL)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        self._wheel(event, 1 / WHEEL)

    def _wheel(self, event: events.MouseEvent, factor: float) -> None:
        event.stop()
        self.viewport.zoom(factor, (event.y, event.x))
        self._draw_soon()

    def on_mouse_down(self, event: events.MouseDown) -> None:
        if event.button == 1:
            self._grabbed = (event.screen_x, event.screen_y)
            self._dragged = False
            self.capture_mouse()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._grabbed is None:
            return
        x, y = self._grabbed
        self._grabbed = event.screen_x, event.screen_y
        if self._grabbed != (x, y):
            self._dragged = True
            self.viewport.pan(x - event.screen_x, event.screen_y - y)
            self._draw_soon()

    def on_mouse_up(self, event: events.MouseUp) -> None:
        if self._grabbed is None:
            return
        self._grabbed = None
        self.release_mouse()
        if not self._dragged and self.viewport.holds((event.y, event.x)):
            self.viewport.cursor = (event.y, event.x)
            self._aim = None
            self.action_pick()
            self._draw_soon()

    def watch_has_focus(self, focused: bool) -> None:
        super().watch_has_focus(focused)
        self.draw()

    def notify_style_update(self) -> None:
        """Redraws in another theme, since every colour is mixed with its background."""
        super().notify_style_update()
        palette = self._mixed() if self.is_attached else None
        # A move of the focus comes here, too, but changes no colour.
        if palette != self._palette:
            self._palette = palette
            self._canvas = None
            self.draw()

    def _mixed(self) -> Palette:
        return palette_of(self.app, self.background_colors[1], self.colors[3])

    def _draw_soon(self) -> None:
        """Draws once for all requests until then."""
        if not self._due:
            self._due = True
            self.call_later(self._draw_due)

    def _draw_due(self) -> None:
        self._due = False
        self.draw()

    def draw(self) -> None:
        view = self.viewport.view
        if view is None or not self.is_attached:
            return
        palette = self._palette = self._palette or self._mixed()
        cursor = self.viewport.cursor if self.aims else None
        canvas, self.picture = self._drawing.frame(self.shown, view, palette, cursor)
        changed = canvas.changed_rows(self._canvas)
        self._canvas = canvas
        for row in changed:
            self._strips.pop(row, None)
        if changed:
            self.refresh(*(Region(0, row, self.size.width, 1) for row in changed))
        self._show_pointed(view)

    def render_line(self, y: int) -> Strip:
        width, height = self.size
        if self.notice:
            lines = Text(plain(self.notice), justify="center").wrap(self.app.console, max(1, width))
            index = y - max(0, (height - len(lines)) // 2)
            text = lines[index].plain if 0 <= index < len(lines) else ""
            return Strip([Segment(text.center(width)[:width], self.rich_style)])
        if self._canvas is None or y >= self._canvas.chars.shape[0]:
            return Strip.blank(width, self.rich_style)
        if y not in self._strips:
            from ddenv.workbench.map.map_drawing import strip

            self._strips[y] = strip(self._canvas, y)
        return self._strips[y]

    def _show_pointed(self, view: View) -> None:
        """The model under the crosshair in the panel's lower border, else the width of the map."""
        model = self.model_at_cursor if self.aims else None
        if model != self._pointed:
            self._pointed = model
            self.post_message(self.Pointed(model))
        subtitle = Text(f"{view.columns * view.scale:.3g} m wide")
        if self.picking:
            x, y = view.point(self.viewport.cursor)
            subtitle = Text(f"x {x:.2f}, y {y:.2f} m")
        elif model is not None:
            subtitle = self.describe(model, self.size.width - 4)
        elif not self.place.prints:
            subtitle = Text("" if self.notice else "this world has no models")
        # Another one draws the whole border.
        if subtitle != self._subtitle_shown and isinstance(self.parent, Widget):
            self._subtitle_shown = self.parent.border_subtitle = subtitle


class Viewport:
    """A `view` (None before the map has a size) and a `cursor` (row, column) in it.

    While `fitted`, the view shows everything important; zooming and panning end that.
    """

    def __init__(self) -> None:
        self.view: View | None = None
        self.cursor: Cell = (0, 0)
        self.fitted = True

    def resize(self, columns: int, rows: int, fitting: Callable[[int, int], View]) -> None:
        """Changes the size or the important places: `fitting` returns a view of these for a
        size.
        """
        view = self.view
        if view is None or self.fitted:
            new = fitting(columns, rows)
        else:
            new = replace(view, columns=columns, rows=rows)
        # Drawings are reused for a view, so an equal view stays the same object.
        if new == view:
            return
        if view is None or self.cursor == (view.rows // 2, view.columns // 2):
            # The crosshair is in the middle until the user moves it; then it keeps its place in the
            # world.
            self.cursor = rows // 2, columns // 2
        else:
            clipped = min(self.cursor[0], rows - 1), min(self.cursor[1], columns - 1)
            self.cursor = new.cell(*view.point(self.cursor)) or clipped
        self.view = new

    def zoom(self, factor: float, about: Cell | None) -> None:
        if self.view is not None:
            self._look(self.view.zoomed(factor, self.view.point(about) if about else None))

    def pan(self, columns: float, rows: float) -> None:
        if self.view is not None:
            self._look(self.view.panned(columns, rows))

    def pan_part(self, right: int, up: int) -> None:
        if self.view is not None:
            self.pan(right * max(1, self.view.columns // 8), up * max(1, self.view.rows // 4))

    def step(self, right: int, up: int) -> None:
        row = self.cursor[0] - up
        column = self.cursor[1] + right
        if self.holds((row, column)):
            self.cursor = row, column
        else:
            self.pan(right, up)

    def holds(self, cell: Cell) -> bool:
        return (
            self.view is not None
            and 0 <= cell[0] < self.view.rows
            and 0 <= cell[1] < self.view.columns
        )

    def center_on(self, x: float, y: float) -> None:
        if self.view is not None:
            self._look(self.view.around(x, y))
            self.cursor = self.view.cell(x, y) or self.cursor

    def _look(self, view: View) -> None:
        self.fitted = False
        self.view = view
