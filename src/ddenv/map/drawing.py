"""What drawings of a world share: which part they show and how large, axes, outlines, and the names on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ddenv.map.labels import HEIGHT, Label, Spot, place_labels, spot
from ddenv.map.raster import extent
from ddenv.text import plain, shortened
from ddenv.world.extent import convex_hull

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

# Maximum distance outside the page, pixels: some viewers fail on large numbers.
FAR = 1e5
LONGEST_LABEL = 26  # columns
CROSS = 4.0  # half the size of the mark of a model without shapes, pixels
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """The rectangle from `low` to `high`, m, drawn with `scale` pixels per m at `left` and `top` on the page, pixels."""

    low: np.ndarray
    high: np.ndarray
    scale: float
    left: float
    top: float

    @classmethod
    def around(
        cls,
        models: Sequence[Drawn],
        points: Sequence[Point],
        margin: float,
        least: float,
        most: Point,
        room: Point,
        at: Point,
    ) -> Frame:
        """As large as `most` (pixels) allows, with all `points` and models but huge ones, and at least `least` m along each axis.

        The `margin` is a part of the longer side. The drawing fills at least `room` (pixels), and begins `at` left, top.
        """
        low, high = extent([each.outline for each in models], points)
        aside = np.maximum(max(0.3, margin * float(max(high - low))), (least - (high - low)) / 2)
        low, high = low - aside, high + aside
        scale = float(min(most / (high - low)))
        sides = np.maximum(high - low, np.array(room) / scale)
        center = (low + high) / 2
        return cls(center - sides / 2, center + sides / 2, scale, *at)

    @property
    def box(self) -> np.ndarray:
        """Left, top, right and bottom, pixels."""
        width, height = (self.high - self.low) * self.scale
        return np.array([self.left, self.top, self.left + width, self.top + height])

    def holds(self, point: Point) -> bool:
        """Whether the point (m) is on the map."""
        return bool((self.low <= point).all() and (point <= self.high).all())

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 2) m to (N, 2) pixels, y downwards."""
        away = (points - (self.low[0], self.high[1])) * (self.scale, -self.scale)
        pixels: np.ndarray = np.clip(away, -FAR, FAR) + np.array([self.left, self.top])
        return pixels

    def pixel(self, point: Point) -> Point:
        """A point (m) on the page, pixels."""
        x, y = self.pixels(np.array([point]))[0].tolist()
        return x, y


def tick_step(span: float, most: int) -> float:
    """The smallest of 1, 2, 5, 10, 20 ... (and 0.5, 0.2, 0.1 ...) m of which `most` or fewer fit into `span` m."""
    least = span / max(1, most)
    if not (math.isfinite(least) and least > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in (1, 2, 5, 10, 20) if power * factor >= least * (1 - 1e-9))


def ticks(low: float, high: float, step: float) -> list[float]:
    """The multiples of `step` from `low` to `high`, m."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # Adding zero turns -0.0 into 0.0.
    return [number * step + 0.0 for number in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """`value` with as many decimals as `step` needs."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{value:.{decimals}f}"


def axes(frame: Frame, most: int, grid: Callable[[float], str], text: str) -> Iterator[str]:
    """Grid lines with their numbers, at most `most` along an axis, and the names of the axes.

    `grid(value)` are the attributes of the line at `value` m, `text` those of a number.
    """
    left, top, right, bottom = frame.box
    step = tick_step(float(max(frame.high - frame.low)), most)
    for value in ticks(frame.low[0], frame.high[0], step):
        x, _ = frame.pixel((value, 0.0))
        yield f'<path {grid(value)} d="M{x:.1f} {top:.1f}V{bottom:.1f}"/>'
        yield f'<text {text} x="{x:.1f}" y="{bottom + 17:.1f}" text-anchor="middle">{tick_text(value, step)}</text>'
    for value in ticks(frame.low[1], frame.high[1], step):
        _, y = frame.pixel((0.0, value))
        yield f'<path {grid(value)} d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
        yield f'<text {text} x="{left - 7:.1f}" y="{y + 4:.1f}" text-anchor="end">{tick_text(value, step)}</text>'
    yield f'<text {text} x="{right:.1f}" y="{bottom + 34:.1f}" text-anchor="end">x, m</text>'
    y = (top + bottom) / 2
    yield f'<text {text} transform="translate(13 {y:.1f}) rotate(-90)" text-anchor="middle">y, m</text>'


def path_of(each: Drawn, frame: Frame, coarse: bool = False) -> str:
    """The path of a model's polygons, or with `coarse` of one outline around them; a model without shapes is a small cross."""
    polygons = each.outline.polygons
    if not polygons:
        x, y = frame.pixel(each.outline.center)
        return f"M{x - CROSS:.1f} {y - CROSS:.1f}l8 8m0 -8l-8 8"
    shapes = [convex_hull(np.vstack(polygons))] if coarse else polygons
    corners = (frame.pixels(shape) for shape in shapes)
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in shape) + "Z" for shape in corners)


def labels(
    models: Sequence[Drawn], wanted: Sequence[int], frame: Frame, points: Sequence[Point], around: float
) -> Iterator[tuple[Drawn, Label]]:
    """The names of the `wanted` of `models` that have room for one; none comes nearer to `points` (m) than `around`, pixels."""
    names = [shortened(each.model.name, LONGEST_LABEL) for each in models]
    marks = [np.array([x - around, y - around, x + around, y + around]) for x, y in map(frame.pixel, points)]
    placed = place_labels(names, [_spot(each, frame) for each in models], wanted, frame.box, marks)
    return ((models[index], label) for index, label in placed.items())


def _spot(each: Drawn, frame: Frame) -> Spot:
    if each.outline.polygons:
        return spot(frame.pixels(convex_hull(np.vstack(each.outline.polygons))), frame.box, each.floor)
    around = CROSS * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return spot(frame.pixels(np.array([each.outline.center])) + around, frame.box, False)


def name_plate(label: Label, ground: str, text: str, least: float = 0.0) -> str:
    """A name on its own background, so that outlines and neighbours do not make it hard to read.

    `ground` and `text` are the attributes of both; the letters have at least the size `least`, pixels.
    """
    size = max(least, label.size)
    long, high = 1.04 * label.length * size / label.size + 4, HEIGHT * size
    turn = f" rotate({label.angle:.1f})" if abs(label.angle) > 0.05 else ""
    return (
        f'<g transform="translate({label.x:.1f} {label.y:.1f}){turn}">'
        f'<rect {ground} {rectangle(np.array([-long, -high, long, high]) / 2)} rx="2"/>'
        f'<text {text} y="{0.35 * size:.1f}" font-size="{size:g}">{written(label.text)}</text></g>'
    )


def rectangle(box: np.ndarray) -> str:
    """The attributes of the rectangle with this left, top, right and bottom."""
    left, top, right, bottom = box
    return f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'


def written(text: str) -> str:
    """`text` as it stands in an SVG file: it may come from an untrusted one."""
    return escape(plain(text))
