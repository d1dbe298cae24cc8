"""The map of a world as one self-contained SVG file, for reports, slides and browsers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape

import numpy as np

from ddenv.map.colors import RGB, blend, packed, readable
from ddenv.map.footprints import Drawn, plan
from ddenv.map.frame import Frame, tick_step, tick_text, ticks
from ddenv.map.labels import HEIGHT, Label, Spot, place_labels, spot
from ddenv.map.raster import extent
from ddenv.text import printable, shortened
from ddenv.world.extent import convex_hull
from ddenv.world.model import World, is_ground

# Maximum width and height and minimum width of the map, and its margins, pixels.
WIDEST, HIGHEST, NARROWEST = 1100.0, 780.0, 360.0
LEFT, TOP, RIGHT, BOTTOM = 64.0, 72.0, 28.0, 92.0
CORNERS = 48  # of the polygon that stands for a circle
LEAST = 4.0  # minimum extent of the world along each axis, m
MOST_LABELS = 60
LONGEST_LABEL = 26  # columns
CROSS = 4  # half the size of the mark of a model without shapes, pixels
WHITE: RGB = (255, 255, 255)
BLACK: RGB = (0, 0, 0)
INK, FAINT, GRID = "#24292f", "#6e7781", "#e7eaee"
START, GOAL = "#1f6feb", "#1a7f37"
FONT = "font-family=\"Inter, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif\""


def svg_map(
    world: World, *, spawn: tuple[float, float, float] | None = None, goal: tuple[float, float] | None = None
) -> str:
    """The world from above, without its ground.

    If given, marks `spawn`, x, y (m) and yaw (rad), and `goal`, x, y (m); all finite.
    """
    models = plan(world, CORNERS)
    points = [point[:2] for point in (spawn, goal) if point is not None]
    frame = _frame(models, points)
    _, _, right, bottom = frame.box
    width, height = right + RIGHT, bottom + BOTTOM
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" {FONT}>',
        f"<title>{_text(world.path.name)}</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        *_head(world, models),
        *_axes(frame),
        f'<clipPath id="map"><rect {_rectangle(frame.box)}/></clipPath>',
        '<g clip-path="url(#map)" stroke-linejoin="round">',
        *(_model(each, frame) for each in models),
        "</g>",
        *_labels(models, frame, points),
        *_marks(frame, spawn, goal),
        f'<rect {_rectangle(frame.box)} fill="none" stroke="{FAINT}"/>',
        *_foot(frame, models),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _frame(models: Sequence[Drawn], points: Sequence[tuple[float, float]]) -> Frame:
    low, high = extent([each.outline for each in models], points)
    margin = max(0.3, 0.04 * float(max(high - low)))
    # A single crate must not fill the page.
    margin = np.maximum(margin, (LEAST - (high - low)) / 2)
    low, high = low - margin, high + margin
    scale = min(WIDEST / (high[0] - low[0]), HIGHEST / (high[1] - low[1]))
    # A long and narrow world gets a frame that has room for its title.
    sides = np.maximum(high - low, np.array([NARROWEST, NARROWEST / 3]) / scale)
    center = (low + high) / 2
    return Frame(center - sides / 2, center + sides / 2, float(scale), LEFT, TOP)


def _head(world: World, models: Sequence[Drawn]) -> Iterator[str]:
    moving = sum(not each.model.static for each in models)
    grounds = sum(is_ground(model) for model in world.models)
    parts = [f"{len(models)} model" + "s" * (len(models) != 1)]
    parts += [f"{moving} dynamic"] if moving else []
    parts += ["ground not drawn"] if grounds else []
    name = _text(shortened(world.path.name, 48))
    yield f'<text x="{LEFT:.0f}" y="34" font-size="20" font-weight="600" fill="{INK}">{name}</text>'
    yield f'<text x="{LEFT:.0f}" y="56" font-size="13" fill="{FAINT}">{" · ".join(parts)}</text>'


def _axes(frame: Frame) -> Iterator[str]:
    """Grid lines with their numbers, and the names of the axes."""
    left, top, right, bottom = frame.box
    step = tick_step(max(frame.high - frame.low), 16)
    yield f'<g font-size="12" fill="{FAINT}" stroke-width="1">'
    for value in ticks(frame.low[0], frame.high[0], step):
        x = frame.pixels(np.array([[value, 0.0]]))[0, 0]
        yield f'<path d="M{x:.1f} {top:.1f}V{bottom:.1f}" stroke="{_grid(value)}"/>'
        yield f'<text x="{x:.1f}" y="{bottom + 18:.1f}" text-anchor="middle">{tick_text(value, step)}</text>'
    for value in ticks(frame.low[1], frame.high[1], step):
        y = frame.pixels(np.array([[0.0, value]]))[0, 1]
        yield f'<path d="M{left:.1f} {y:.1f}H{right:.1f}" stroke="{_grid(value)}"/>'
        yield f'<text x="{left - 8:.1f}" y="{y + 4:.1f}" text-anchor="end">{tick_text(value, step)}</text>'
    yield f'<text x="{(left + right) / 2:.1f}" y="{bottom + 40:.1f}" text-anchor="middle" fill="{INK}">x, m</text>'
    y = (top + bottom) / 2
    yield f'<text transform="translate(18 {y:.1f}) rotate(-90)" text-anchor="middle" fill="{INK}">y, m</text>'
    yield "</g>"


def _grid(value: float) -> str:
    """The colour of a grid line; the axes themselves stand out."""
    return "#c4cad1" if value == 0 else GRID


def _model(each: Drawn, frame: Frame) -> str:
    fill = _fill(each)
    edge = blend(fill, BLACK, 0.45)
    dashes = "" if each.model.static else ' stroke-dasharray="5 3"'
    # Models with many small parts would be all outline.
    thick = 1.4 if dashes else 0.5 if len(each.outline.polygons) > 8 else 1.0
    style = f'fill="{_hex(fill)}" fill-opacity="0.92" stroke="{_hex(edge)}" stroke-width="{thick}"{dashes}'
    return f"<g {style}><title>{_tooltip(each)}</title>{_drawn(each, frame)}</g>"


def _drawn(each: Drawn, frame: Frame) -> str:
    """One path of all polygons; a model without shapes is a small cross."""
    polygons = [_path(frame.pixels(polygon)) for polygon in each.outline.polygons]
    if polygons:
        return f'<path d="{"".join(polygons)}"/>'
    (left, top), _, (right, bottom), _ = _cross(each, frame)
    ends = f"M{left:.1f} {top:.1f}L{right:.1f} {bottom:.1f}M{left:.1f} {bottom:.1f}L{right:.1f} {top:.1f}"
    return f'<path d="{ends}" stroke="{INK}" stroke-width="1.5"/>'


def _cross(each: Drawn, frame: Frame) -> np.ndarray:
    """The corners of the cross of a model without shapes, pixels."""
    corners: np.ndarray = CROSS * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    placed: np.ndarray = frame.pixels(np.array([each.outline.center])) + corners
    return placed


def _path(corners: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in corners) + "Z"


def _fill(each: Drawn) -> RGB:
    """Floors are light, and low models are paler than high ones."""
    return blend(WHITE, each.color, 0.2 if each.floor else 0.6 + 0.25 * each.shade)


def _tooltip(each: Drawn) -> str:
    x, y, z = each.model.pose.position
    size = " x ".join(f"{part:.2f}" for part in each.size)
    kind = "static" if each.model.static else "dynamic"
    yaw = each.model.pose.yaw()
    words = f"{kind}, {size} m\npose {x:.2f}, {y:.2f}, {z:.2f} m, yaw {yaw:.2f} rad, top at {each.top:.2f} m"
    return f"{_text(each.model.name)}\n{words}"


def _labels(models: Sequence[Drawn], frame: Frame, points: Sequence[tuple[float, float]]) -> Iterator[str]:
    spots = [_spot(each, frame) for each in models]
    names = [shortened(each.model.name, LONGEST_LABEL) for each in models]
    largest = sorted(range(len(models)), key=lambda index: -models[index].outline.area)[:MOST_LABELS]
    around = np.array([-16, -16, 16, 16])
    marks = [np.tile(frame.pixels(np.array([point]))[0], 2) + around for point in points]
    yield '<g text-anchor="middle" pointer-events="none">'
    for index, label in place_labels(names, spots, largest, frame.box, marks).items():
        yield _label(label, models[index])
    yield "</g>"


def _spot(each: Drawn, frame: Frame) -> Spot:
    if not each.outline.polygons:
        return spot(_cross(each, frame), frame.box, False)
    return spot(frame.pixels(convex_hull(np.vstack(each.outline.polygons))), frame.box, each.floor)


def _label(label: Label, each: Drawn) -> str:
    """A name on its own background, so that outlines and neighbours do not make it hard to read."""
    fill = _fill(each) if label.inside else WHITE
    color = f"#{readable(packed(fill)):06x}"
    long, high = 1.04 * label.length, HEIGHT * label.size
    ground = np.array([-long / 2, -high / 2, long / 2, high / 2])
    turn = f" rotate({label.angle:.1f})" if abs(label.angle) > 0.05 else ""
    return (
        f'<g transform="translate({label.x:.1f} {label.y:.1f}){turn}">'
        f'<rect {_rectangle(ground)} rx="2" fill="{_hex(fill)}" fill-opacity="0.8"/>'
        f'<text y="{0.35 * label.size:.1f}" font-size="{label.size:g}" fill="{color}">{_text(label.text)}</text></g>'
    )


def _marks(frame: Frame, spawn: tuple[float, float, float] | None, goal: tuple[float, float] | None) -> Iterator[str]:
    if spawn is not None:
        x, y = frame.pixels(np.array([spawn[:2]]))[0]
        yield (
            f'<g transform="translate({x:.1f} {y:.1f})"><title>start ({spawn[0]:g}, {spawn[1]:g}) m, yaw {spawn[2]:g} rad</title>'
            f'<path transform="rotate({-math.degrees(spawn[2]):.1f})" d="M8 -10L30 0L8 10Z" fill="{START}"/>'
            f"{_badge('S', START)}</g>"
        )
    if goal is not None:
        x, y = frame.pixels(np.array([goal]))[0]
        title = f"<title>goal ({goal[0]:g}, {goal[1]:g}) m</title>"
        yield f'<g transform="translate({x:.1f} {y:.1f})">{title}{_badge("G", GOAL)}</g>'


def _badge(sign: str, color: str) -> str:
    return (
        f'<circle r="12" fill="{color}" stroke="#ffffff" stroke-width="2"/>'
        f'<text y="5" text-anchor="middle" font-size="14" font-weight="700" fill="#ffffff">{sign}</text>'
    )


def _foot(frame: Frame, models: Sequence[Drawn]) -> Iterator[str]:
    """The scale bar and the legend of outlines."""
    left, _, right, bottom = frame.box
    y = bottom + 68
    step = tick_step(frame.high[0] - frame.low[0], 6)
    start = right - step * frame.scale
    yield f'<path d="M{start:.1f} {y - 5:.1f}v5H{right:.1f}v-5" fill="none" stroke="{INK}" stroke-width="1.5"/>'
    yield (
        f'<text x="{start - 8:.1f}" y="{y + 1:.1f}" text-anchor="end" font-size="12" fill="{INK}">'
        f"{tick_text(step, step)} m</text>"
    )
    if all(each.model.static for each in models):
        return
    for x, word, dashes in ((left, "static", ""), (left + 90, "dynamic", ' stroke-dasharray="5 3"')):
        yield f'<rect x="{x:.1f}" y="{y - 10:.1f}" width="20" height="12" fill="#f3f4f6" stroke="{FAINT}"{dashes}/>'
        yield f'<text x="{x + 27:.1f}" y="{y:.1f}" font-size="12" fill="{INK}">{word}</text>'


def _rectangle(box: np.ndarray) -> str:
    left, top, right, bottom = box
    return f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'


def _text(text: str) -> str:
    return escape(printable(text))


def _hex(color: RGB) -> str:
    return f"#{packed(color):06x}"
