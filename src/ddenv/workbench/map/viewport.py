"""The part of the plane that a map shows, and the crosshair, which moves from cell to cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ddenv.map.cells import Cell
    from ddenv.map.raster import View


class Viewport:
    """A `view` (None before the map has a size) and a `cursor` (row, column) in it.

    While `fitted`, the view shows everything important; zooming and panning end that.
    """

    def __init__(self) -> None:
        self.view: View | None = None
        self.cursor: Cell = (0, 0)
        self.fitted = True

    def resize(self, columns: int, rows: int, fitting: Callable[[int, int], View]) -> None:
        """Changes the size or the important places: `fitting` returns a view of these for a size."""
        view = self.view
        new = fitting(columns, rows) if view is None or self.fitted else replace(view, columns=columns, rows=rows)
        # Drawings are reused for a view, so an equal view stays the same object.
        if new == view:
            return
        if view is None or self.cursor == (view.rows // 2, view.columns // 2):
            # The crosshair is in the middle until the user moves it; then it keeps its place in the world.
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
        row, column = self.cursor[0] - up, self.cursor[1] + right
        if self.holds((row, column)):
            self.cursor = row, column
        else:
            self.pan(right, up)

    def holds(self, cell: Cell) -> bool:
        return self.view is not None and 0 <= cell[0] < self.view.rows and 0 <= cell[1] < self.view.columns

    def center_on(self, x: float, y: float) -> None:
        if self.view is not None:
            self._look(self.view.around(x, y))
            self.cursor = self.view.cell(x, y) or self.cursor

    def _look(self, view: View) -> None:
        self.fitted, self.view = False, view
