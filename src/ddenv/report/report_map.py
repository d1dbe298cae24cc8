"""The map of a report: the world from above with what is left of it, what was removed, f, and the
robot's paths.

Its colours are classes of `style.css`, so that it follows the reader's light or dark page.
"""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from ddenv.map.drawing import FAR, Frame, at, badge, labels, path_of, plot, written
from ddenv.map.footprints import Drawn, rings
from ddenv.page.step_chart import opening
from ddenv.report.run_data import Record
from ddenv.runfile.run_settings import settings
from ddenv.runs.changes import Limit
from ddenv.runs.playback import table
from ddenv.world.pose import Point

# Paths of the robot by their sign: flat rows of `COLUMNS` floats, or None.
Ways = Mapping[str, "array[float] | None"]
PATHS = ("way", "last", "with", "without", "now", "changed")
# Outlines of models that have moved, by the verdict there.
LIMITS = {"f": "until", "goal": "from", "other": "over", "impossible": "over"}

# Of the legend: entries in a line, and pixels from line to line.
ACROSS = 4
LINE = 24.0


# Around (0, 0): where the robot starts, where it should go, and where it ended in f.
MARKS = {
    "start": badge("start", "S"),
    "goal": badge("goal", "G"),
    "end": (
        '<path class="ring" d="M-7 -7L7 7M-7 7L7 -7"/><path class="end" d="M-7 -7L7 7M-7 7L7 -7"/>'
    ),
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
    "now": "path now",
    "changed": "path, number changed",
    "until": "f up to here",
    "from": "goal from here",
    "over": "no f from here",
    "start": "start",
    "goal": "goal",
    "end": "end of f",
}
# Pixels: the drawing's own width, the highest and the lowest map, and the margins.
WIDTH = 880.0
HIGHEST = 620.0
LEAST_HIGH = 180.0
LEFT = 52.0
TOP = 10.0
RIGHT = 14.0
AXIS = 46.0
# The minimum drawn along each axis, m.
LEAST = 2.0
# The maximum number of labels, and how many of the models drawn last they must not hide.
MOST_LABELS = 24
MOST_AVOIDED = 1000
# The maximum number of points on a path.
MOST_POINTS = 500
# With more polygons in all, each model is drawn as one outline around it.
MOST_POLYGONS = 20_000


def picture(
    record: Record,
    name: str = "all",
    ways: Ways | None = None,
    named: Collection[str] | None = None,
    limits: Sequence[Limit] = (),
) -> str:
    """The map of a run as SVG. `name` is different for each map of a page.

    `ways` are paths of the robot in place of those in f and in the last similar run; with `named`,
    the map has the names of these models, in place of those that are left. `limits` are outlined.
    """
    across = WIDTH - LEFT - RIGHT
    # As wide as the page, and never too flat.
    sizes = (across, HIGHEST), (across, LEAST_HIGH)
    frame = Frame.around(
        record.models, list(_places(record).values()), 0.03, LEAST, *sizes, (LEFT, TOP)
    )
    if ways is None:
        last = record.evidence if record.evidence is not record.original else None
        ways = {"way": record.original, "last": last}
    models = record.models
    places = {sign: point for sign, point in _places(record).items() if frame.holds(point)}
    sorts = {each.model.name: _sort(record, each.model.name) for each in models}
    coarse = sum(len(each.outline.polygons) for each in models) > MOST_POLYGONS
    drawn = {way: path for way, samples in ways.items() if (path := _way(samples, frame))}
    outlines = [
        (LIMITS[verdict], ring) for verdict, model, moved in limits for ring in rings(model, moved)
    ]
    shown = {*sorts.values(), *drawn, *places, *(sign for sign, _ in outlines)}
    legend = [name for name in WORDS if name in shown]
    bottom = float(frame.box[3]) + AXIS
    height = bottom + LINE * -(-len(legend) // ACROSS) + 6
    inside = [
        *(_model(each, sorts[each.model.name], frame, coarse) for each in models),
        *(f'<path class="{sign}" d="{_line(frame, ring)}"/>' for sign, ring in outlines),
        *(f'<path class="{way}" d="{path}"/>' for way, path in drawn.items()),
        *_near(record, frame, places),
    ]
    # By default what is left has a name, or keeps names away; a name may cover the rest, which is
    # faint.
    own = [
        one
        for one in models
        if (sorts[one.model.name] != "gone" if named is None else one.model.name in named)
    ]
    own = own[-MOST_AVOIDED:]
    wanted = [index for index, each in enumerate(own) if sorts[each.model.name] != "still"]
    names = labels(own, wanted, MOST_LABELS, frame, list(places.values()), 11.0)
    marks = [at(frame.pixel(point), MARKS[sign]) for sign, point in places.items()]
    drawing = plot(frame, 12, name, inside, [*names, *marks])
    return "\n".join([opening(height), *drawing, *_legend(legend, bottom), "</svg>"])


def _places(record: Record) -> dict[str, Point]:
    """Where the start, the goal and f's end are, x, y (m), if they are known and not far
    outside.
    """
    places: dict[str, Point] = {}
    if record.scenario is not None:
        spawn = record.scenario.robot.spawn
        goal = record.scenario.goal
        places = {"start": (spawn.x, spawn.y), "goal": (goal.x, goal.y)}
    if record.state.f_position is not None:
        places["end"] = record.state.f_position[:2]
    return {sign: place for sign, place in places.items() if max(map(abs, place)) < FAR}


def _sort(record: Record, name: str) -> str:
    if name not in record.elements:
        return "still"
    kept = "kept" if name in record.kept else "gone"
    if record.state.baseline is None:
        return "whole"
    return kept


def _model(each: Drawn, sort: str, frame: Frame, coarse: bool) -> str:
    parts = 1 if coarse else len(each.outline.polygons)
    kind = "" if each.outline.polygons else " bare"
    if each.floor:
        kind = " floor"
    many = " many" if parts > 8 else ""
    title = f"<title>{written(each.model.name)} ({WORDS[sort]})</title>"
    return f'<path class="{sort}{kind}{many}" d="{path_of(each, frame, coarse)}">{title}</path>'


def _way(samples: array[float] | None, frame: Frame) -> str:
    if not samples:
        return ""
    points = table(samples)[:, 1:3]
    # The end matters most.
    return _line(frame, np.vstack([points[:: max(1, -(-len(points) // MOST_POINTS))], points[-1:]]))


def _line(frame: Frame, points: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in frame.pixels(points))


def _near(record: Record, frame: Frame, places: Mapping[str, Point]) -> Iterator[str]:
    """Circles: where the goal counts as reached, and where similar runs end, from above."""
    reach = record.scenario.goal.tolerance if record.scenario is not None else 0.0
    for sign, radius, name in (
        ("goal", reach, "reach"),
        ("end", settings(record.state).epsilon, "around"),
    ):
        if sign in places and 0 < radius < FAR:
            x, y = frame.pixel(places[sign])
            yield (
                f'<circle class="{name}" cx="{x:.1f}" cy="{y:.1f}" '
                f'r="{min(FAR, radius * frame.scale):.1f}"/>'
            )


def _legend(shown: Sequence[str], top: float) -> Iterator[str]:
    """The signs that are `shown` with their words, in columns from `top` on."""
    for number, name in enumerate(shown):
        sign = f'<rect class="{name}" x="1" y="-7" width="24" height="14"/>'
        if name in MARKS:
            sign = at((13, 0), MARKS[name])
        elif name in PATHS or name in LIMITS.values():
            sign = f'<path class="{name}" d="M0 0H26"/>'
        row, column = divmod(number, ACROSS)
        place = LEFT + (WIDTH - LEFT) / ACROSS * column, top + LINE * row + 10
        yield at(place, f'{sign}\n<text class="tick" x="33" y="4.5">{WORDS[name]}</text>')
