"""A view of the plane that keys and the mouse move: zoom, pan, drag, and a crosshair that goes from cell to cell."""

from __future__ import annotations

from textual import events
from textual.widget import Widget

from ddenv.map.cells import Cell
from ddenv.map.raster import View


class Panning(Widget):
    """Keeps a view and a `cursor` (row, column). What derives from it says what fits in `fitting`, and draws in `draw`."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._view: View | None = None
        self.cursor: Cell = (0, 0)
        self._fitted = True
        self._due = False
        self._grabbed: tuple[int, int] | None = None
        self._dragged = False

    def fitting(self, columns: int, rows: int) -> View:
        """A view of all that matters."""
        raise NotImplementedError

    def draw(self) -> None:
        """The view or the cursor changed."""
        raise NotImplementedError

    def clicked(self) -> None:
        """The mouse was clicked where the crosshair is now."""

    @property
    def aims(self) -> bool:
        """Whether the crosshair is shown."""
        return self.has_focus

    # Which part of the plane.

    def zoom(self, factor: float) -> None:
        """Closer by `factor`, about the crosshair where there is one, else about the middle."""
        if self._view is not None:
            self._look(self._view.zoomed(factor, self._view.point(self.cursor) if self.aims else None))

    def fit(self) -> None:
        """Shows all that matters again."""
        self._fitted = True
        self.refit()

    def pan(self, columns: float, rows: float) -> None:
        """Looks at what is so many cells to the right and upwards."""
        if self._view is not None:
            self._look(self._view.panned(columns, rows))

    def refit(self) -> None:
        """Another size, or other things that matter."""
        columns, rows = self.size
        if not columns or not rows:
            return
        if self._view is None or (self._view.columns, self._view.rows) != (columns, rows):
            self.cursor = self._moved(columns, rows)
        if self._fitted or self._view is None:
            self._view = self.fitting(columns, rows)
        else:
            self._view = View(self._view.x, self._view.y, self._view.scale, columns, rows)
        self.draw()

    def _moved(self, columns: int, rows: int) -> Cell:
        """The crosshair in a map of another size; in the middle until it is moved."""
        view = self._view
        if view is None or self.cursor == (view.rows // 2, view.columns // 2):
            return rows // 2, columns // 2
        return min(self.cursor[0], rows - 1), min(self.cursor[1], columns - 1)

    def _look(self, view: View) -> None:
        self._fitted = False
        self._view = view
        self._soon()

    def _soon(self) -> None:
        """Draws once for all that has been asked for until then."""
        if not self._due:
            self._due = True
            self.call_later(self._draw_due)

    def _draw_due(self) -> None:
        self._due = False
        self.draw()

    # Keys.

    def action_pan(self, right: int, up: int) -> None:
        """An eighth of the map to the right, or a quarter up."""
        if self._view is not None:
            self.pan(right * max(1, self._view.columns // 8), up * max(1, self._view.rows // 4))

    def action_move(self, right: int, up: int) -> None:
        """The crosshair by a cell; at the border the map goes on."""
        if self._view is None:
            return
        row, column = self.cursor[0] - up, self.cursor[1] + right
        if 0 <= row < self._view.rows and 0 <= column < self._view.columns:
            self.cursor = row, column
            self._soon()
        else:
            self.pan(right, up)

    # The mouse.

    def on_resize(self) -> None:
        self.refit()

    def watch_has_focus(self, focused: bool) -> None:
        super().watch_has_focus(focused)
        self.draw()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        self._wheel(event, 1.25)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        self._wheel(event, 0.8)

    def _wheel(self, event: events.MouseEvent, factor: float) -> None:
        event.stop()
        if self._view is not None:
            self._look(self._view.zoomed(factor, self._view.point((event.y, event.x))))

    def on_mouse_down(self, event: events.MouseDown) -> None:
        if event.button == 1:
            self._grabbed, self._dragged = (event.screen_x, event.screen_y), False
            self.capture_mouse()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        if self._grabbed is None:
            return
        x, y = self._grabbed
        self._grabbed = event.screen_x, event.screen_y
        if self._grabbed != (x, y):
            self._dragged = True
            self.pan(x - event.screen_x, event.screen_y - y)

    def on_mouse_up(self, event: events.MouseUp) -> None:
        if self._grabbed is None:
            return
        self._grabbed = None
        self.release_mouse()
        view = self._view
        if not self._dragged and view is not None and 0 <= event.y < view.rows and 0 <= event.x < view.columns:
            self.cursor = event.y, event.x
            self.clicked()
            self._soon()
