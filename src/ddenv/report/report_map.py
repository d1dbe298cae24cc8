"""The map of a report: the world from above with what is left of it, what was removed, f, and the robot's paths.

Its colours are classes of `style.css`, so that it follows the reader's light or dark page.
"""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ddenv.map.footprints import Drawn
from ddenv.map.frame import FAR, Frame, tick_step, tick_text, ticks
from ddenv.map.labels import HEIGHT, Spot, place_labels, spot
from ddenv.map.raster import extent
from ddenv.page.blocks import section
from ddenv.report.run_data import Record
from ddenv.runfile.store import COLUMNS
from ddenv.text import plain, shortened
from ddenv.world.extent import convex_hull

# Paths of the robot by their sign: flat rows of `COLUMNS` floats, or None.
Ways = Mapping[str, "array[float] | None"]

# Pixels: of a letter, between entries, and from line to line.
LETTER, GAP, LINE, LEGEND_LEFT = 6.9, 12.0, 24.0, 52.0


def _badge(name: str, letter: str) -> str:
    return f'<circle class="badge {name}" r="10"/><text class="sign" y="4.5">{letter}</text>'


# Around (0, 0): where the robot starts, where it should go, and where it ended in f.
MARKS = {
    "start": _badge("start", "S"),
    "goal": _badge("goal", "G"),
    "end": '<path class="ring" d="M-7 -7L7 7M-7 7L7 -7"/><path class="end" d="M-7 -7L7 7M-7 7L7 -7"/>',
}
WORDS = {
    "kept": "left",
    "gone": "removed",
    "still": "always there",
    "whole": "can be removed",
    "way": "path in f",
    "last": "path, last similar run",
    "with": "path with it",
    "without": "path without it",
    "start": "start",
    "goal": "goal",
    "end": "end of f",
}


def legend_height(shown: Sequence[str], width: float) -> float:
    """The height of the legend of these signs below a map of this width, pixels."""
    return LINE * len(_lines(shown, width)) + 6


def legend(shown: Sequence[str], top: float, width: float) -> Iterator[str]:
    """The signs with their words, in lines from `top` on."""
    for number, line in enumerate(_lines(shown, width)):
        x, y = LEGEND_LEFT, top + LINE * number + 10
        for name in line:
            yield f'<g transform="translate({x:.1f} {y:.1f})">{_sign(name)}'
            yield f'<text class="tick" x="{_room(name):g}" y="4.5">{WORDS[name]}</text></g>'
            x += _wide(name)


def _lines(shown: Sequence[str], width: float) -> list[list[str]]:
    lines: list[list[str]] = [[]]
    x = LEGEND_LEFT
    for name in (name for name in WORDS if name in shown):
        if lines[-1] and x + _wide(name) > width:
            lines.append([])
            x = LEGEND_LEFT
        lines[-1].append(name)
        x += _wide(name)
    return lines


def _wide(name: str) -> float:
    return _room(name) + LETTER * len(WORDS[name]) + GAP


def _room(name: str) -> float:
    """The width of a sign with the space before its word."""
    return 25.0 if name in MARKS else 33.0


def _sign(name: str) -> str:
    if name in MARKS:
        return f'<g transform="translate(10 0)">{MARKS[name]}</g>'
    if name in PATHS:
        return f'<path class="{name}" d="M0 0H26"/>'
    return f'<rect class="{name}" x="1" y="-7" width="24" height="14"/>'


PATHS = ("way", "last", "with", "without")

# Pixels: the drawing's own width, the highest map and close-up, the lowest map, and the margins.
WIDTH, HIGHEST, CLOSE_HIGH, LEAST_HIGH = 880.0, 620.0, 420.0, 180.0
LEFT, TOP, RIGHT, AXIS = 52.0, 10.0, 14.0, 46.0
CORNERS = 32
# The minimum drawn along each axis: of the world and of a close-up, m; and the minimum magnification of a close-up.
LEAST, CLOSE, CLOSER = 4.0, 2.0, 3.0
# The maximum number of labels, their maximum length, and how many of the models drawn last they must not hide.
MOST_LABELS, LONGEST_LABEL, MOST_AVOIDED = 24, 26, 1000
# The maximum number of points on a path.
MOST_POINTS = 500
# With more polygons in all, each model is drawn as one outline around it.
MOST_POLYGONS = 20_000
CROSS = 4.0


def picture(record: Record, models: Sequence[Drawn], name: str = "all") -> str:
    """The map of a run as SVG; `models` are its world's, with circles of `CORNERS`. `name` is different for each map of a page."""
    points = [point for point in _places(record) if point is not None]
    return _picture(record, models, _frame(models, points, LEAST), name, _ways(record))


def _ways(record: Record) -> Ways:
    last = record.evidence if record.evidence is not record.original else None
    return {"way": record.original, "last": last}


def two_ways(
    record: Record, models: Sequence[Drawn], ways: Ways, name: str, named: Collection[str] | None = None
) -> str:
    """The map with two paths of the robot, "with" and "without" a model, in place of those in f.

    With `named`, the map has the names of these models, in place of those that are left.
    """
    points = [point for point in _places(record) if point is not None]
    return _picture(record, models, _frame(models, points, LEAST), name, ways, named)


def close_up(record: Record, models: Sequence[Drawn]) -> str:
    """A map of only what is left and f's end; "" if it would add little to the whole map."""
    kept = [each for each in models if each.model.name in record.kept]
    end = _places(record)[2]
    if end is None or not kept:
        return ""
    points = [point for point in _places(record) if point is not None]
    frame = _frame(kept, [end], CLOSE, CLOSE_HIGH)
    if frame.scale < CLOSER * _frame(models, points, LEAST).scale:
        return ""
    return _picture(record, models, frame, "near", _ways(record))


def _picture(
    record: Record,
    models: Sequence[Drawn],
    frame: Frame,
    name: str,
    ways: Ways,
    named: Collection[str] | None = None,
) -> str:
    """`name` is different for each picture of a page."""
    start, goal, end = (point if frame.holds(point) else None for point in _places(record))
    points = [point for point in (start, goal, end) if point is not None]
    sorts = {each.model.name: _sort(record, each.model.name) for each in models}
    coarse = sum(len(each.outline.polygons) for each in models) > MOST_POLYGONS
    drawn = [(way, path) for way, samples in ways.items() if (path := _way(samples, frame))]
    shown = [*dict.fromkeys(sorts.values()), *(way for way, _ in drawn)]
    shown += [sign for sign, point in (("start", start), ("goal", goal), ("end", end)) if point is not None]
    bottom = float(frame.box[3]) + AXIS
    height = bottom + legend_height(shown, WIDTH)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="drawing" role="img" viewBox="0 0 {WIDTH:.0f} {height:.0f}">',
        *_axes(frame),
        f'<clipPath id="{name}"><rect {_rectangle(frame.box)}/></clipPath>',
        f'<g clip-path="url(#{name})">',
        *(_model(each, sorts[each.model.name], frame, coarse) for each in models),
        *(f'<path class="{way}" d="{path}"/>' for way, path in drawn),
        *_near(record, frame, goal, end),
        "</g>",
        *_labels([each for each in models if _has_name(each.model.name, sorts, named)], sorts, frame, points),
        *_marks(frame, start, goal, end),
        f'<rect {_rectangle(frame.box)} class="frame"/>',
        *legend(shown, bottom, WIDTH),
        "</svg>",
    ]
    return "\n".join(lines)


def _places(record: Record) -> tuple[Any, Any, Any]:
    """Start, goal and f's end, each x, y (m) or None."""
    scenario, position = record.state.scenario, record.state.f_position
    start, goal = section(section(scenario, "robot"), "spawn"), section(scenario, "goal")
    end = {} if position is None else dict(zip("xy", position[:2], strict=True))
    return _point(start), _point(goal), _point(end)


def _point(place: dict[str, Any]) -> tuple[float, float] | None:
    numbers = [
        value for value in (place.get("x"), place.get("y")) if isinstance(value, (int, float)) and abs(value) < FAR
    ]
    return (float(numbers[0]), float(numbers[1])) if len(numbers) == 2 else None


def _sort(record: Record, name: str) -> str:
    """The class of a model: kept, gone, or always there."""
    state = record.state
    if name not in record.elements:
        return "still"
    if state.baseline is None:
        return "whole"
    return "kept" if name in record.kept else "gone"


def _frame(
    models: Sequence[Drawn], points: Sequence[tuple[float, float]], least: float, most: float = HIGHEST
) -> Frame:
    low, high = extent([each.outline for each in models], points)
    margin = np.maximum(max(0.3, 0.03 * float(max(high - low))), (least - (high - low)) / 2)
    low, high = low - margin, high + margin
    across = WIDTH - LEFT - RIGHT
    scale = float(min(across / (high[0] - low[0]), most / (high[1] - low[1])))
    # The map is as wide as the page, and never too flat.
    sides = np.maximum(high - low, np.array([across, LEAST_HIGH]) / scale)
    center = (low + high) / 2
    return Frame(center - sides / 2, center + sides / 2, scale, LEFT, TOP)


def _axes(frame: Frame) -> Iterator[str]:
    """Grid lines with their numbers, and the names of the axes."""
    left, top, right, bottom = frame.box
    step = tick_step(float(max(frame.high - frame.low)), 12)
    for value in ticks(frame.low[0], frame.high[0], step):
        x = frame.pixels(np.array([[value, 0.0]]))[0, 0]
        yield f'<path class="grid" d="M{x:.1f} {top:.1f}V{bottom:.1f}"/>'
        yield f'<text class="tick" x="{x:.1f}" y="{bottom + 17:.1f}" text-anchor="middle">{tick_text(value, step)}</text>'
    for value in ticks(frame.low[1], frame.high[1], step):
        y = frame.pixels(np.array([[0.0, value]]))[0, 1]
        yield f'<path class="grid" d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
        yield f'<text class="tick" x="{left - 7:.1f}" y="{y + 4:.1f}" text-anchor="end">{tick_text(value, step)}</text>'
    yield f'<text class="tick" x="{right:.1f}" y="{bottom + 34:.1f}" text-anchor="end">x, m</text>'
    y = (top + bottom) / 2
    yield f'<text class="tick" transform="translate(13 {y:.1f}) rotate(-90)" text-anchor="middle">y, m</text>'


def _model(each: Drawn, sort: str, frame: Frame, coarse: bool) -> str:
    flat = " floor" if each.floor else ""
    words = {"kept": "left", "gone": "removed", "still": "always there", "whole": "can be removed"}[sort]
    title = f"<title>{_text(each.model.name)} ({words})</title>"
    polygons = each.outline.polygons
    if not polygons:
        x, y = frame.pixels(np.array([each.outline.center]))[0]
        ends = f"M{x - CROSS:.1f} {y - CROSS:.1f}l8 8m0 -8l-8 8"
        return f'<path class="{sort} bare" d="{ends}">{title}</path>'
    shapes = [convex_hull(np.vstack(polygons))] if coarse else polygons
    path = "".join(_closed(frame.pixels(shape)) for shape in shapes)
    many = " many" if len(shapes) > 8 else ""
    return f'<path class="{sort}{flat}{many}" d="{path}">{title}</path>'


def _closed(corners: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in corners) + "Z"


def _way(samples: array[float] | None, frame: Frame) -> str:
    """The robot's path, or "" if unknown."""
    if not samples:
        return ""
    points = np.frombuffer(samples, dtype=float).reshape(-1, COLUMNS)[:, 1:3]
    step = max(1, -(-len(points) // MOST_POINTS))
    # The end matters most.
    chosen = np.vstack([points[::step], points[-1:]])
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in frame.pixels(chosen))


def _near(record: Record, frame: Frame, goal: Any, end: Any) -> Iterator[str]:
    """Circles: where the goal counts as reached, and where similar runs end, from above."""
    scenario = record.state.scenario
    pairs = [(goal, section(scenario, "goal").get("tolerance", 0.5), "reach")]
    pairs += [(end, section(scenario, "failure").get("epsilon", 0.33), "around")]
    for point, radius, name in pairs:
        if point is not None and isinstance(radius, (int, float)) and 0 < radius < FAR:
            x, y = frame.pixels(np.array([point]))[0]
            yield f'<circle class="{name}" cx="{x:.1f}" cy="{y:.1f}" r="{min(FAR, radius * frame.scale):.1f}"/>'


def _labels(
    models: Sequence[Drawn], sorts: dict[str, str], frame: Frame, points: Sequence[tuple[float, float]]
) -> Iterator[str]:
    """Names of `models`, the largest first, but not of those that are always there."""
    seen = models[-MOST_AVOIDED:]
    spots = [_spot(each, frame) for each in seen]
    names = [shortened(each.model.name, LONGEST_LABEL) for each in seen]
    named = [index for index, each in enumerate(seen) if sorts[each.model.name] != "still"]
    largest = sorted(named, key=lambda index: -seen[index].outline.area)[:MOST_LABELS]
    around = np.array([-14, -14, 14, 14])
    marks = [np.tile(frame.pixels(np.array([point]))[0], 2) + around for point in points]
    for label in place_labels(names, spots, largest, frame.box, marks).values():
        turn = f" rotate({label.angle:.1f})" if abs(label.angle) > 0.05 else ""
        size = max(11.0, label.size)
        long, high = 1.04 * label.length * size / label.size + 4, HEIGHT * size
        yield (
            f'<g transform="translate({label.x:.1f} {label.y:.1f}){turn}">'
            f'<rect class="plate" x="{-long / 2:.1f}" y="{-high / 2:.1f}" width="{long:.1f}" height="{high:.1f}" rx="2"/>'
            f'<text class="label" y="{0.35 * size:.1f}" font-size="{size:g}">{_text(label.text)}</text></g>'
        )


def _has_name(model: str, sorts: dict[str, str], named: Collection[str] | None) -> bool:
    """Whether a model has a name, or keeps names away: by default what is left. A name may cover the rest, which is faint."""
    return sorts[model] != "gone" if named is None else model in named


def _spot(each: Drawn, frame: Frame) -> Spot:
    if each.outline.polygons:
        return spot(frame.pixels(convex_hull(np.vstack(each.outline.polygons))), frame.box, each.floor)
    around = CROSS * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return spot(frame.pixels(np.array([each.outline.center])) + around, frame.box, False)


def _marks(frame: Frame, start: Any, goal: Any, end: Any) -> Iterator[str]:
    for point, sign in ((start, "start"), (goal, "goal"), (end, "end")):
        if point is not None:
            x, y = frame.pixels(np.array([point]))[0]
            yield f'<g transform="translate({x:.1f} {y:.1f})">{MARKS[sign]}</g>'


def _rectangle(box: np.ndarray) -> str:
    left, top, right, bottom = box
    return f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'


def _text(text: str) -> str:
    return escape(plain(text))
