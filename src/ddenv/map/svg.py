"""The map of a world as one self-contained SVG file, for reports, slides and browsers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ddenv.map.colors import RGB, blend, packed, readable
from ddenv.map.drawing import Frame, Point, axes, labels, name_plate, path_of, rectangle, tick_step, tick_text, written
from ddenv.map.footprints import Drawn, plan
from ddenv.text import count, shortened
from ddenv.world.model import World, is_ground

# Maximum width and height and minimum width of the map, and its margins, pixels.
WIDEST, HIGHEST, NARROWEST = 1100.0, 780.0, 360.0
LEFT, TOP, RIGHT, BOTTOM = 64.0, 72.0, 28.0, 92.0
CORNERS = 48  # of the polygon that stands for a circle
LEAST = 4.0  # minimum extent of the world along each axis, m: a single crate must not fill the page
MOST_LABELS = 60
WHITE: RGB = (255, 255, 255)
BLACK: RGB = (0, 0, 0)
INK, FAINT, GRID, ORIGIN = "#24292f", "#6e7781", "#e7eaee", "#c4cad1"
START, GOAL = "#1f6feb", "#1a7f37"
FONT = "font-family=\"Inter, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif\""


def svg_map(world: World, *, spawn: tuple[float, float, float] | None = None, goal: Point | None = None) -> str:
    """The world from above, without its ground.

    If given, marks `spawn`, x, y (m) and yaw (rad), and `goal`, x, y (m); all finite.
    """
    models = plan(world, CORNERS)
    points = [point[:2] for point in (spawn, goal) if point is not None]
    # A long and narrow world gets a frame that has room for its title.
    room = NARROWEST, NARROWEST / 3
    frame = Frame.around(models, points, 0.04, LEAST, (WIDEST, HIGHEST), room, (LEFT, TOP))
    _, _, right, bottom = frame.box
    width, height = right + RIGHT, bottom + BOTTOM
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" {FONT}>',
        f"<title>{written(world.path.name)}</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        *_head(world, models),
        # The axes themselves stand out.
        *axes(frame, 16, lambda value: f'stroke="{GRID if value else ORIGIN}"', f'font-size="12" fill="{FAINT}"'),
        f'<clipPath id="map"><rect {rectangle(frame.box)}/></clipPath>',
        '<g clip-path="url(#map)" stroke-linejoin="round">',
        *(_model(each, frame) for each in models),
        "</g>",
        *_labels(models, frame, points),
        *_marks(frame, spawn, goal),
        f'<rect {rectangle(frame.box)} fill="none" stroke="{FAINT}"/>',
        *_foot(frame, models),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _head(world: World, models: Sequence[Drawn]) -> Iterator[str]:
    moving = sum(not each.model.static for each in models)
    parts = [count(len(models), "model")]
    parts += [f"{moving} dynamic"] if moving else []
    parts += ["ground not drawn"] if any(map(is_ground, world.models)) else []
    name = written(shortened(world.path.name, 48))
    yield f'<text x="{LEFT:.0f}" y="34" font-size="20" font-weight="600" fill="{INK}">{name}</text>'
    yield f'<text x="{LEFT:.0f}" y="56" font-size="13" fill="{FAINT}">{" · ".join(parts)}</text>'


def _model(each: Drawn, frame: Frame) -> str:
    fill = _fill(each)
    dashes = "" if each.model.static else ' stroke-dasharray="5 3"'
    # Models with many small parts would be all outline.
    thick = 1.4 if dashes else 0.5 if len(each.outline.polygons) > 8 else 1.0
    edge = _hex(blend(fill, BLACK, 0.45))
    style = f'fill="{_hex(fill)}" fill-opacity="0.92" stroke="{edge}" stroke-width="{thick}"{dashes}'
    bare = "" if each.outline.polygons else f' stroke="{INK}" stroke-width="1.5"'
    return f'<g {style}><title>{_tooltip(each)}</title><path d="{path_of(each, frame)}"{bare}/></g>'


def _fill(each: Drawn) -> RGB:
    """Floors are light, and low models are paler than high ones."""
    return blend(WHITE, each.color, 0.2 if each.floor else 0.6 + 0.25 * each.shade)


def _tooltip(each: Drawn) -> str:
    x, y, z = each.model.pose.position
    size = " x ".join(f"{part:.2f}" for part in each.size)
    kind = "static" if each.model.static else "dynamic"
    yaw = each.model.pose.yaw()
    words = f"{kind}, {size} m\npose {x:.2f}, {y:.2f}, {z:.2f} m, yaw {yaw:.2f} rad, top at {each.top:.2f} m"
    return f"{written(each.model.name)}\n{words}"


def _labels(models: Sequence[Drawn], frame: Frame, points: Sequence[Point]) -> Iterator[str]:
    """The names of the largest models."""
    largest = sorted(range(len(models)), key=lambda index: -models[index].outline.area)[:MOST_LABELS]
    yield '<g text-anchor="middle" pointer-events="none">'
    for each, label in labels(models, largest, frame, points, 16):
        fill = _fill(each) if label.inside else WHITE
        yield name_plate(label, f'fill="{_hex(fill)}" fill-opacity="0.8"', f'fill="#{readable(packed(fill)):06x}"')
    yield "</g>"


def _marks(frame: Frame, spawn: tuple[float, float, float] | None, goal: Point | None) -> Iterator[str]:
    if spawn is not None:
        x, y = frame.pixel(spawn[:2])
        yield (
            f'<g transform="translate({x:.1f} {y:.1f})"><title>start ({spawn[0]:g}, {spawn[1]:g}) m, yaw {spawn[2]:g} rad</title>'
            f'<path transform="rotate({-math.degrees(spawn[2]):.1f})" d="M8 -10L30 0L8 10Z" fill="{START}"/>'
            f"{_badge('S', START)}</g>"
        )
    if goal is not None:
        x, y = frame.pixel(goal)
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


def _hex(color: RGB) -> str:
    return f"#{packed(color):06x}"
