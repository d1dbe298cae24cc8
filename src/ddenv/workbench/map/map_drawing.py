"""Draws the map of a world and its run."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ddenv.evidence.took_part import in_last
from ddenv.map.cells import Cell
from ddenv.map.paint import Canvas
from ddenv.map.raster import Outlines, View, fit, pack
from ddenv.runfile.store import COLUMNS
from ddenv.workbench.map.map_colors import Palette
from ddenv.workbench.map.map_words import PARTING, sensed_order
from ddenv.workbench.map.model_looks import Kept, kept, looks
from ddenv.workbench.map.picture import (
    Line,
    Mark,
    Picture,
    Seen,
    crosshair,
    follow,
    foremost,
    names,
    picture,
    riders,
    robots,
    seen,
)
from ddenv.workbench.map.place import MovedPrints, Point, Shown
from ddenv.workbench.shared.poll import Snapshot
from ddenv.world.pose import pose_of

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# Dots of the original path, or of the second way, and of the gaps in it.
DASH = 5
# In a world that is so many times as wide as the ways of the tests that are shown, the map fits these alone.
LARGE = 4


# Lying models are the slow part of a frame: 16 of 19 ms with 3,000 models, and only zooming and panning change it.
@lru_cache(maxsize=4)
def _outlines(prints: tuple[Footprint, ...]) -> Outlines:
    return pack(prints)


@lru_cache(maxsize=4)
def _seen(prints: tuple[Footprint, ...], view: View) -> Seen:
    return seen(_outlines(prints), view)


class MapDrawing:
    """Draws frames of what is `Shown`."""

    def __init__(self) -> None:
        self._trails: dict[int, list[Point]] = {}
        self._moved: MovedPrints | None = None

    def fitting(self, shown: Shown, columns: int, rows: int) -> View:
        """A view of all important places; in a large world, of the ways of finished tests."""
        path = _path(shown.snapshot.evidence)
        points = path[np.isfinite(path).all(axis=1)].tolist()
        points += [point for way in shown.ways for point in way.points.tolist()]
        points += [point for point in (shown.start, shown.place.goal, shown.failure) if point]
        whole = fit(shown.place.prints, points, columns, rows, margin=0.4)
        ways = fit((), points, columns, rows, margin=2.0) if shown.ways else whole
        return ways if whole.scale > LARGE * ways.scale else whole

    def follow(self, snapshot: Snapshot) -> None:
        """Adds to the paths behind the robots that drive now."""
        self._trails = follow(self._trails, snapshot)

    def frame(self, shown: Shown, view: View, palette: Palette, cursor: Cell | None) -> tuple[Canvas, Picture]:
        """A new frame, and its picture without robots and crosshair. Without a `cursor` it has no crosshair."""
        shown = self._with_live(shown)
        still = _still(shown, view, palette)
        canvas, trails = still.canvas.copy(), self._trails if "path" in shown.layers else {}
        if shown.ways:
            riders(canvas, view, still.written, shown.ways, palette, DASH)
        else:
            robots(canvas, view, still.written, shown.snapshot, trails, palette)
        if cursor is not None:
            crosshair(canvas, cursor, still.written, palette)
        return canvas, still

    def _with_live(self, shown: Shown) -> Shown:
        """With the models where they are in the running test whose robot stands out."""
        live = None if shown.ways else foremost(shown.snapshot)
        if (live is None or not live.models) and self._moved is None:
            return shown
        if self._moved is None or self._moved.place is not shown.place:
            self._moved = MovedPrints(shown.place)
        poses = {} if live is None else {name: pose_of(values) for name, values in live.models.items()}
        prints = self._moved.at(poses)
        return shown if prints is shown.place.prints else replace(shown, place=replace(shown.place, prints=prints))


def _still(shown: Shown, view: View, palette: Palette) -> Picture:
    """All but what moves."""
    prints, layers, snapshot = shown.place.prints, shown.layers, shown.snapshot
    lines = [Line(_path(snapshot.evidence), palette.path)] if "path" in layers else []
    if "original" in layers and not shown.same_paths:
        lines.insert(0, Line(_path(snapshot.original), palette.original, DASH))
    if shown.ways:
        both = zip(shown.ways, (palette.path, palette.original), (0, DASH), strict=False)
        lines = [Line(way.points, color, dash) for way, color, dash in both][::-1]
    how, marks = looks(prints, _who(shown), palette), tuple(_marks(shown, palette))
    still = picture(_seen(prints, view), how, removed="removed" in layers, lines=lines, marks=marks)
    if "names" in layers:
        names(still, prints, shown.failure or shown.start)
    return still


def _who(shown: Shown) -> Kept:
    """Which models are in the environment, and how they stand out."""
    place, state, layers = shown.place, shown.snapshot.state, shown.layers
    who, met = kept(state, shown.candidate), in_last(state) if "took part" in layers else None
    if not who.elements:
        who = Kept(place.elements, place.elements)
    return replace(
        who,
        parts=who.parts if "partitions" in layers else {},
        pinned=who.pinned if "pinned" in layers else frozenset(),
        selected=shown.selection,
        sensed=sensed_order(state) if "sensed" in layers else {},
        shown=who.shown if met is None else frozenset(met.names(state.elements)),
    )


def _path(rows: array[float] | None) -> np.ndarray:
    """Flat rows of a motion as (N, 2) m."""
    return np.zeros((0, 2)) if rows is None else np.array(rows, dtype=float).reshape(-1, COLUMNS)[:, 1:3]


def _marks(shown: Shown, palette: Palette) -> Iterator[Mark]:
    places = [(shown.start, "S", palette.start), (shown.place.goal, "G", palette.goal)]
    if "failure" in shown.layers:
        places.append((shown.failure, "×", palette.failure))
    places.append((shown.parting, PARTING, palette.live))
    return (Mark(point, sign, ground) for point, sign, ground in places if point and np.isfinite(point).all())
