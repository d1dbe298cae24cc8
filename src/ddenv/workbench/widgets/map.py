"""The world from above, with the run drawn over it: parts, paths, start, goal, f and the robots that drive now."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from rich.segment import Segment
from rich.text import Text
from textual import events
from textual.binding import Binding
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from ddenv.map.footprints import Footprint
from ddenv.map.paint import RGB, Canvas, blend, packed
from ddenv.map.raster import View, arrow, braille, fit, heading, label_cells, masks, owners
from ddenv.runfile.state import Candidate
from ddenv.runfile.store import COLUMNS
from ddenv.workbench.poll import Snapshot
from ddenv.workbench.widgets.looks import REMOVED, Kept, fill, ghosts, kept, looks
from ddenv.workbench.widgets.strips import strip

Point = tuple[float, float]
LEGEND = (
    ("S", "start"),
    ("G", "goal"),
    ("×", "f"),
    ("⠒", "path"),
    ("↗", "robot"),
    ("·", "removed"),
    ("#", "protected"),
)


@dataclass(frozen=True, slots=True)
class Place:
    """What the map shows besides the run, in m: where the robot starts (x, y, yaw), its goal and the models.

    `elements` are the names of the models that may be removed.
    """

    prints: tuple[Footprint, ...] = ()
    spawn: tuple[float, float, float] | None = None
    goal: Point | None = None
    elements: frozenset[str] = frozenset()


@dataclass(slots=True)
class _Still:
    """What changes only with the view or the environment, kept between frames."""

    view: View | None = None
    filled: list[np.ndarray] = field(default_factory=list)
    centers: np.ndarray | None = None
    who: Kept | None = None
    canvas: Canvas | None = None
    labels: list[tuple[tuple[int, int], str]] = field(default_factory=list)


class WorldMap(Widget, can_focus=True):
    """Top-down map. Give it a `Place`, then snapshots; arrow keys pan it."""

    BINDINGS: ClassVar = [
        Binding("left", "pan(-1, 0)", "pan", show=False, id="map.left", tooltip="move the map to the left"),
        Binding("right", "pan(1, 0)", "pan", show=False, id="map.right", tooltip="move the map to the right"),
        Binding("up", "pan(0, 1)", "pan", show=False, id="map.up", tooltip="move the map up"),
        Binding("down", "pan(0, -1)", "pan", show=False, id="map.down", tooltip="move the map down"),
    ]

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.place = Place()
        self.snapshot = Snapshot()
        self.candidate: Candidate | None = None
        self.notice = "reading the world ..."
        self._view: View | None = None
        self._fitted = True
        self._still = _Still()
        self._canvas: Canvas | None = None
        self._path: tuple[array | None, np.ndarray] = (None, np.zeros((0, 2)))
        self._trails: dict[int, list[Point]] = {}

    # What is shown.

    def set_place(self, place: Place, notice: str = "") -> None:
        """Another world. `notice` is shown instead of a map when there is none."""
        self.place, self.notice = place, notice
        self._fitted = True
        self._still, self._canvas = _Still(), None
        self._refit()
        self.refresh()

    def set_marks(self, spawn: tuple[float, float, float] | None, goal: Point | None) -> None:
        """Other start (x, y, yaw) and goal in the same world."""
        self.place = replace(self.place, spawn=spawn, goal=goal)
        self._refit()

    def show(self, snapshot: Snapshot, candidate: Candidate | None) -> None:
        """The run as it is now; `candidate` is the one whose models stand out."""
        new_path = snapshot.evidence is not self.snapshot.evidence
        self.snapshot, self.candidate = snapshot, candidate
        self._follow(snapshot)
        if new_path:
            rows = np.array(snapshot.evidence if snapshot.evidence is not None else [], dtype=float)
            self._path = (snapshot.evidence, rows.reshape(-1, COLUMNS)[:, 1:3])
            self._refit()
        self._redraw()

    def _follow(self, snapshot: Snapshot) -> None:
        trails: dict[int, list[Point]] = {}
        for live in snapshot.live:
            trail = self._trails.get(live.test, [])
            point = (live.pose[0], live.pose[1])
            if not trail or trail[-1] != point:
                trail.append(point)
            trails[live.test] = trail
        self._trails = trails

    # Which part of the world.

    def zoom(self, factor: float) -> None:
        """Closer by `factor`, about the middle of the map."""
        if self._view is not None:
            self._fitted = False
            self._view = self._view.zoomed(factor)
            self._redraw()

    def fit(self) -> None:
        """Shows all that matters again."""
        self._fitted = True
        self._refit()
        self._redraw()

    def action_pan(self, right: int, up: int) -> None:
        view = self._view
        if view is not None:
            self._fitted = False
            dx, dy = right * view.scale * view.columns / 8, up * view.scale * view.rows / 4
            self._view = View(view.x + dx, view.y + dy, view.scale, view.columns, view.rows)
            self._redraw()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        event.stop()
        self.zoom(1.25)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        event.stop()
        self.zoom(0.8)

    def on_resize(self) -> None:
        self._refit()
        self._redraw()

    def _refit(self) -> None:
        columns, rows = self.size
        if not columns or not rows:
            return
        if self._fitted or self._view is None:
            points = [(float(x), float(y)) for x, y in self._path[1] if np.isfinite((x, y)).all()]
            points += [point for point in (self._start(), self.place.goal, self._failure()) if point]
            self._view = fit(self.place.prints, points, columns, rows, margin=0.4)
        else:
            self._view = View(self._view.x, self._view.y, self._view.scale, columns, rows)
        self._redraw()

    def _start(self) -> Point | None:
        spawn = self.place.spawn
        return None if spawn is None else (spawn[0], spawn[1])

    def _failure(self) -> Point | None:
        base = self.snapshot.state.baseline
        return None if base is None else (base.position[0], base.position[1])

    # Drawing.

    def notify_style_update(self) -> None:
        """Another theme: every colour is mixed with its background."""
        super().notify_style_update()
        self._still = _Still()
        self._canvas = None
        if self.is_attached:
            self._redraw()

    def _redraw(self) -> None:
        """Draws a new frame, and has only the lines refreshed that changed."""
        if self._view is None or not self.is_attached:
            return
        canvas = self._draw(self._view)
        changed = canvas.changed_rows(self._canvas)
        self._canvas = canvas
        if changed:
            self.refresh(*(Region(0, row, self.size.width, 1) for row in changed))
        self._tell_scale()

    def _draw(self, view: View) -> Canvas:
        still, (back, fore) = self._models(view), self._colors()
        canvas = still.canvas.copy()
        focus = {test.id for test in self.snapshot.running if self._in_focus(test.candidate)}
        canvas.dots(braille(self._path[1], view), packed(blend(back, fore, 0.75)))
        for test, trail in self._trails.items():
            color = (255, 215, 80) if test in focus or not focus else blend(back, fore, 0.5)
            canvas.dots(braille(np.array(trail), view), packed(color))
        for cell, label in still.labels:
            canvas.put(cell, label)
        self._marks(canvas, view)
        for live in self.snapshot.live:
            cell = view.cell(live.pose[0], live.pose[1])
            bright = live.test in focus or not focus
            shade = packed((255, 215, 80) if bright else blend(back, fore, 0.5))
            canvas.put(cell, arrow(heading(live.pose[3:])), 0x000000, shade)
        return canvas

    def _in_focus(self, candidate: int | None) -> bool:
        focus = self.snapshot.focus
        return focus is not None and focus.index == candidate

    def _models(self, view: View) -> _Still:
        """The models as they stand, with the places of their letters."""
        still, who, prints = self._still, kept(self.snapshot.state, self.candidate), self.place.prints
        if not who.elements:
            who = Kept(self.place.elements, self.place.elements)
        if view != still.view:
            centers = view.pixels(np.array([each.center for each in prints]).reshape(-1, 2))
            still = self._still = _Still(view, masks(prints, view), centers)
        if who == still.who:
            return still
        back, fore = self._colors()
        canvas, how = Canvas(view.rows, view.columns, back), looks(prints, who, back, fore)
        grid = owners(still.filled, view, np.flatnonzero(how.kinds != REMOVED))
        fill(canvas, grid, how)
        ghosts(
            canvas,
            owners(still.filled, view, np.flatnonzero(how.kinds == REMOVED)),
            grid,
            how,
            packed(blend(back, fore, 0.35)),
        )
        cells = label_cells(grid, still.centers)
        still.labels = [(cell, label) for cell, label in zip(cells, how.labels, strict=True) if cell and label]
        still.who, still.canvas = who, canvas
        return still

    def _colors(self) -> tuple[RGB, RGB]:
        """Background and text."""
        return self.background_colors[1].rgb, self.colors[3].rgb

    def _marks(self, canvas: Canvas, view: View) -> None:
        """S, G and × on grounds of their own, so that they are found at once."""
        marks = ((self._start(), "S", 0x1F6FEB), (self.place.goal, "G", 0x1A7F37), (self._failure(), "×", 0xCF222E))
        for point, sign, ground in marks:
            if point is not None and np.isfinite(point).all():
                canvas.put(view.cell(*point), sign, 0xFFFFFF, ground)

    def _tell_scale(self) -> None:
        view = self._view
        parent = self.parent
        if view is not None and isinstance(parent, Widget) and self.place.prints:
            parent.border_subtitle = Text(f"{view.columns * view.scale:.3g} m wide")

    def render_line(self, y: int) -> Strip:
        if self.notice:
            return self._tell(y)
        if self._canvas is None or y >= self._canvas.chars.shape[0]:
            return Strip.blank(self.size.width, self.rich_style)
        return strip(self._canvas, y)

    def _tell(self, y: int) -> Strip:
        lines = Text(self.notice, justify="center").wrap(self.app.console, max(1, self.size.width))
        index = y - max(0, (self.size.height - len(lines)) // 2)
        text = lines[index].plain if 0 <= index < len(lines) else ""
        return Strip([Segment(text.center(self.size.width)[: self.size.width], self.rich_style)])


def legend(width: int, *, parts: bool = True) -> Text:
    """One line that says what the signs mean, as many as fit in `width`."""
    text = Text(no_wrap=True, overflow="ellipsis")
    entries = (("A B", "parts"), *LEGEND) if parts else LEGEND[:2]
    for sign, meaning in entries:
        if text.cell_len + len(sign) + len(meaning) + 3 > width:
            break
        text.append(f"{sign}", "bold").append(f" {meaning}  ", "dim")
    return text
