"""The map of a world as one self-contained SVG file, for reports, slides and browsers."""

from __future__ import annotations

import math

from ddenv.map.colors import RGB, blend, packed
from ddenv.map.drawing import Frame, at, badge, labels, path_of, plot, tick, written
from ddenv.map.footprints import Drawn, plan
from ddenv.text import count, shortened
from ddenv.world.model import World
from ddenv.world.pose import Point, Vector

# Maximum width and height and minimum width of the map, and its margins, pixels.
WIDEST = 1100.0
HIGHEST = 780.0
NARROWEST = 360.0
LEFT = 64.0
TOP = 72.0
RIGHT = 28.0
BOTTOM = 52.0
CORNERS = 48  # of the polygon that stands for a circle
LEAST = 2.0  # minimum extent of the world along each axis, m: a single crate must not fill the page
MOST_LABELS = 60
WHITE: RGB = (255, 255, 255)
BLACK: RGB = (0, 0, 0)
STYLE = """
svg { font: 12px Inter, "Segoe UI", Helvetica, Arial, "DejaVu Sans", sans-serif; }
.title { font-size: 20px; font-weight: 600; fill: #24292f; }
.tick { fill: #6e7781; }
.grid { stroke: #e7eaee; }
.origin { stroke: #c4cad1; }
.frame { fill: none; stroke: #6e7781; }
.model { fill-opacity: 0.92; stroke-width: 1; stroke-linejoin: round; }
.many { stroke-width: 0.5; }
.dynamic { stroke-width: 1.4; stroke-dasharray: 5 3; }
.bare { stroke: #24292f; stroke-width: 1.5; }
.plate { fill: none; }
.label { text-anchor: middle; pointer-events: none; paint-order: stroke; }
.label { stroke: #ffffff; stroke-opacity: 0.7; stroke-width: 3; }
.badge { stroke: #ffffff; stroke-width: 2; }
.start { fill: #1f6feb; }
.goal { fill: #1a7f37; }
.sign { fill: #ffffff; font-weight: 700; text-anchor: middle; }
"""


def svg_map(world: World, *, spawn: Vector | None = None, goal: Point | None = None) -> str:
    """The world from above, without its ground.

    If given, marks `spawn`, x, y (m) and yaw (rad), and `goal`, x, y (m); all finite.
    """
    models = plan(world, CORNERS)
    points = [point[:2] for point in (spawn, goal) if point is not None]
    # A long and narrow world gets a frame that has room for its title.
    frame = Frame.around(
        models, points, 0.04, LEAST, (WIDEST, HIGHEST), (NARROWEST, NARROWEST / 3), (LEFT, TOP)
    )
    width = frame.box[2] + RIGHT
    height = frame.box[3] + BOTTOM
    names = labels(models, range(len(models)), MOST_LABELS, frame, points)
    marks = []
    if spawn is not None:
        x, y, yaw = spawn
        title = f"<title>start ({x:g}, {y:g}) m, yaw {yaw:g} rad</title>"
        arrow = (
            f'<path class="start" transform="rotate({-math.degrees(yaw):.1f})" d="M7 -8L26 0L7 '
            '8Z"/>'
        )
        marks.append(at(frame.pixel((x, y)), f"{title}{arrow}{badge('start', 'S')}"))
    if goal is not None:
        title = f"<title>goal ({goal[0]:g}, {goal[1]:g}) m</title>"
        marks.append(at(frame.pixel(goal), f"{title}{badge('goal', 'G')}"))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}">',
        f"<style>{STYLE}</style>",
        f"<title>{written(world.path.name)}</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        (
            f'<text class="title" x="{LEFT:.0f}" '
            f'y="34">{written(shortened(world.path.name, 48))}</text>'
        ),
        tick(LEFT, 56, "start", f"{count(len(models), 'model')}, without the ground"),
        *plot(frame, 16, "map", (_model(each, frame) for each in models), [*names, *marks]),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _model(each: Drawn, frame: Frame) -> str:
    kinds = ["model"]
    # Models with many small parts would be all outline.
    kinds += ["many"] if len(each.outline.polygons) > 8 else []
    kinds += [] if each.model.static else ["dynamic"]
    kinds += [] if each.outline.polygons else ["bare"]
    fill = blend(WHITE, each.color, 0.2 if each.floor else 0.8)
    color = f'fill="#{packed(fill):06x}" stroke="#{packed(blend(fill, BLACK, 0.45)):06x}"'
    x, y, z = each.model.pose.position
    yaw = each.model.pose.yaw()
    size = " x ".join(f"{part:.2f}" for part in each.size)
    words = (
        f"{written(each.model.name)}\n{'static' if each.model.static else 'dynamic'}, {size} m\n"
    )
    words += f"pose {x:z.2f}, {y:z.2f}, {z:z.2f} m, yaw {yaw:z.2f} rad, top at {each.top:.2f} m"
    return (
        f'<path class="{" ".join(kinds)}" {color} '
        f'd="{path_of(each, frame)}"><title>{words}</title></path>'
    )
