"""A world and its run seen from above. What stays as it is is kept between frames, and only changed lines are drawn again."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from rich.segment import Segment
from rich.text import Text
from textual.geometry import Region
from textual.strip import Strip

from ddenv.map import arrays as np
from ddenv.map.paint import Canvas
from ddenv.map.raster import Outlines, View, fit, pack
from ddenv.runfile.state import Candidate
from ddenv.runfile.store import COLUMNS
from ddenv.workbench.map.described import legend, sensed_order
from ddenv.workbench.map.looks import Kept, Looks, kept, looks
from ddenv.workbench.map.map_colors import Palette, palette_of, unpacked
from ddenv.workbench.map.moving import crosshair, follow, robots, strip
from ddenv.workbench.map.panning import Panning
from ddenv.workbench.map.picture import Line, Mark, Picture, Point, Seen, picture, seen
from ddenv.workbench.map.place import Place
from ddenv.workbench.run.poll import Snapshot
from ddenv.workbench.wording import plain

if TYPE_CHECKING:
    from ddenv.runfile.state import Trial

LAYERS = ("partitions", "removed", "pinned", "sensed", "path", "original", "failure")
# Dots of the original path, and of the gaps in it.
DASH = 5


class Overview(Panning):
    """Give it a `Place`, then snapshots. `shown_layers` are of `LAYERS`, `selection` are the models that were selected."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.place = Place()
        self.snapshot = Snapshot()
        self.candidate: Candidate | Trial | None = None
        self.notice = "reading the world ..."
        self.shown_layers = frozenset(LAYERS) - {"sensed"}
        self.selection: frozenset[str] = frozenset()
        self._outlines: Outlines | None = None
        self._palette: Palette | None = None
        self._seen: Seen | None = None
        self._picture: Picture | None = None
        self._canvas: Canvas | None = None
        self._strips: dict[int, Strip] = {}
        self._paths: dict[str, tuple[array | None, np.ndarray]] = {}
        self._trails: dict[int, list[Point]] = {}
        # Each with what it was made from.
        self._who: tuple[tuple, Kept] = ((), Kept())
        self._looked: tuple[tuple, Looks | None] = ((), None)
        self._compared: tuple[tuple, bool] = ((), True)
        self._drawn: tuple[tuple, tuple[Mark, ...]] = ((), ())

    # What is shown.

    def set_place(self, place: Place, notice: str = "") -> None:
        """Another world. `notice` is shown instead of a map when there is none."""
        self.place, self.notice = place, notice
        self._outlines = pack(place.prints)
        self._seen, self._picture, self._canvas = None, None, None
        self._fitted = True
        self.refit()
        self.refresh()

    def set_marks(self, spawn: tuple[float, float, float] | None, goal: Point | None) -> None:
        """Other start (x, y, yaw) and goal in the same world."""
        self.place = replace(self.place, spawn=spawn, goal=goal)
        self.refit()

    def show(self, snapshot: Snapshot, candidate: Candidate | Trial | None) -> None:
        """The run as it is now; `candidate` is the one whose models stand out."""
        new_path = snapshot.evidence is not self.snapshot.evidence
        self.snapshot, self.candidate = snapshot, candidate
        self._trails = follow(self._trails, snapshot)
        if new_path and self._fitted:
            self.refit()
        else:
            self.draw()

    def toggle_layer(self, name: str) -> None:
        """Shows one of `LAYERS`, or no longer."""
        self.shown_layers ^= {name}
        self.draw()

    def legend(self, width: int) -> Text:
        """One line that says what the signs on the map mean, as many as fit."""
        state, extra = self.snapshot.state, []
        if self.selection:
            extra.append(("*", "selected"))
        if state.pinned and "pinned" in self.shown_layers:
            extra.append(("+", "pinned"))
        if "sensed" in self.shown_layers and state.evidence_test is not None:
            extra.append(("1 2", "order sensed"))
        if "original" in self.shown_layers and not self._same_paths():
            extra.append(("⠒ ⠒", "path of f"))
        return legend(width, parts=bool(state.elements), extra=extra)

    # Which part of the world.

    def refit(self) -> None:
        # Until there is a world there is nothing to look at, and what draws it need not be loaded.
        if not self.notice or self.place.prints:
            super().refit()

    def fitting(self, columns: int, rows: int) -> View:
        path = self._path("evidence", self.snapshot.evidence)
        points = path[np.isfinite(path).all(axis=1)].tolist()
        points += [point for point in (self._start(), self.place.goal, self._failure()) if point]
        return fit(self.place.prints, points, columns, rows, margin=0.4)

    def _path(self, name: str, rows: array | None) -> np.ndarray:
        """Flat rows of a motion as (N, 2) m: the same array as long as they are the same."""
        if name not in self._paths or self._paths[name][0] is not rows:
            values = np.zeros((0, 2)) if rows is None else np.array(rows, dtype=float).reshape(-1, COLUMNS)[:, 1:3]
            self._paths[name] = (rows, values)
        return self._paths[name][1]

    def _same_paths(self) -> bool:
        """Whether the last similar run went as f did: it is f before the first reduction."""
        key = (self.snapshot.original, self.snapshot.evidence)
        if not _same(key, self._compared[0]):
            self._compared = (key, key[0] is None or key[0] == key[1])
        return self._compared[1]

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
        palette = self._mixed() if self.is_attached else None
        # Each move of the focus comes here, too, and changes no colour.
        if palette != self._palette:
            self._palette, self._canvas = palette, None
            self.draw()

    def _mixed(self) -> Palette:
        return palette_of(self.app, self.background_colors[1], self.colors[3])

    def draw(self) -> None:
        """Draws a new frame, and has only the lines refreshed that changed."""
        if self._view is None or not self.is_attached:
            return
        palette = self._palette = self._palette or self._mixed()
        drawn = self._still(self._view, palette)
        canvas, trails = drawn.canvas.copy(), self._trails if "path" in self.shown_layers else {}
        robots(canvas, self._view, drawn.written, self.snapshot, trails, palette)
        if self.aims:
            crosshair(canvas, self.cursor, drawn.written, palette)
        changed = canvas.changed_rows(self._canvas)
        self._canvas = canvas
        for row in changed:
            self._strips.pop(row, None)
        if changed:
            self.refresh(*(Region(0, row, self.size.width, 1) for row in changed))

    def _still(self, view: View, palette: Palette) -> Picture:
        """All but what moves, drawn again only if something of it changed."""
        layers = self.shown_layers
        paths = self._path("evidence", self.snapshot.evidence), self._path("original", self.snapshot.original)
        if self._seen is None or self._seen.view != view:
            self._seen = seen(self._outlines, view)
        how, marks = self._looks(palette), tuple(self._marks(palette))
        key = (self._seen, how, layers, *paths)
        if self._picture is None or not _same(key, self._drawn[0]) or marks != self._drawn[1]:
            lines = tuple(self._lines(palette, *paths))
            self._picture = picture(self._seen, how, removed="removed" in layers, lines=lines, marks=marks)
            self._drawn = (key, marks)
        return self._picture

    def _looks(self, palette: Palette) -> Looks:
        key = (self._kept(), palette, self.place.prints)
        if self._looked[1] is None or not _same(key, self._looked[0]):
            how = looks(self.place.prints, key[0], unpacked(palette.back), unpacked(palette.fore), palette)
            self._looked = (key, how)
        return self._looked[1]

    def _kept(self) -> Kept:
        """Who is in the environment, gathered again only if something of it changed."""
        state, candidate, layers = self.snapshot.state, self.candidate, self.shown_layers
        shown = (candidate,)
        if isinstance(candidate, Candidate):
            shown = (candidate.split, candidate.kind, candidate.partition)
        split = state.round.split if state.round else None
        key = (state.elements, state.environment, split, state.pinned, *shown, state.evidence_test)
        key = (*key, self.selection, layers, self.place.elements)
        if _same(key, self._who[0]):
            return self._who[1]
        who = kept(state, candidate)
        if not who.elements:
            who = Kept(self.place.elements, self.place.elements)
        who = replace(
            who,
            parts=who.parts if "partitions" in layers else {},
            pinned=who.pinned if "pinned" in layers else frozenset(),
            selected=self.selection,
            sensed=sensed_order(state) if "sensed" in layers else {},
        )
        self._who = (key, who)
        return who

    def _lines(self, palette: Palette, evidence: np.ndarray, original: np.ndarray) -> Iterator[Line]:
        if "original" in self.shown_layers and not self._same_paths():
            yield Line(original, palette.original, DASH)
        if "path" in self.shown_layers:
            yield Line(evidence, palette.path)

    def _marks(self, palette: Palette) -> Iterator[Mark]:
        places = [(self._start(), "S", palette.start), (self.place.goal, "G", palette.goal)]
        if "failure" in self.shown_layers:
            places.append((self._failure(), "×", palette.failure))
        return (Mark(point, sign, ground) for point, sign, ground in places if point and np.isfinite(point).all())

    def render_line(self, y: int) -> Strip:
        if self.notice:
            return self._tell(y)
        if self._canvas is None or y >= self._canvas.chars.shape[0]:
            return Strip.blank(self.size.width, self.rich_style)
        if y not in self._strips:
            self._strips[y] = strip(self._canvas, y)
        return self._strips[y]

    def _tell(self, y: int) -> Strip:
        lines = Text(plain(self.notice), justify="center").wrap(self.app.console, max(1, self.size.width))
        index = y - max(0, (self.size.height - len(lines)) // 2)
        text = lines[index].plain if 0 <= index < len(lines) else ""
        return Strip([Segment(text.center(self.size.width)[: self.size.width], self.rich_style)])


def _same(before: tuple, now: tuple) -> bool:
    """Whether they hold the very same things: to compare thousands of names would take too long in each frame."""
    return len(before) == len(now) and all(one is other for one, other in zip(before, now, strict=True))
