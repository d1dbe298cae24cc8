"""What drawings of a world share: which part they show and how large, axes, outlines, marks, and the names on them.

They have no colours but classes: grid, origin, tick, frame, plate, label, badge, sign.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ddenv.map.raster import extent
from ddenv.text import plain, shortened, width
from ddenv.world.extent import convex_hull

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

# Maximum distance outside the page, pixels: some viewers fail on large numbers.
FAR = 1e5
CROSS = 4.0  # half the size of the mark of a model without shapes, pixels
# Of names: fonts, the preferred first, pixels; mean width and height of a letter, relative to the font size; space around, pixels.
SIZES = (12.0, 10.5, 9.0)
WIDTH, HEIGHT = 0.58, 1.15
GAP = 3.0
LONGEST_LABEL = 26  # columns
MARK = 14.0  # half the size of a mark, with some space, pixels
# Maximum fraction of a name that may cover other models.
MOST_COVERED = 0.3
# A model at least this many times larger than a name may carry the name of another model.
LARGE = 10.0
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


def plot(frame: Frame, most: int, name: str, inside: Iterable[str], above: Iterable[str]) -> Iterator[str]:
    """A map in its axes: what is `inside` is cut off at its frame, names and marks `above` it are not.

    An axis has at most `most` numbers; `name` is different for each map of a page.
    """
    left, top, right, bottom = frame.box
    step = tick_step(float(max(frame.high - frame.low)), most)
    for value in ticks(frame.low[0], frame.high[0], step):
        x, _ = frame.pixel((value, 0.0))
        yield f'<path class="{_grid(value)}" d="M{x:.1f} {top:.1f}V{bottom:.1f}"/>'
        yield tick(x, bottom + 17, "middle", tick_text(value, step))
    for value in ticks(frame.low[1], frame.high[1], step):
        _, y = frame.pixel((0.0, value))
        yield f'<path class="{_grid(value)}" d="M{left:.1f} {y:.1f}H{right:.1f}"/>'
        yield tick(left - 7, y + 4, "end", tick_text(value, step))
    yield tick(right, bottom + 34, "end", "x, m")
    turned = f"translate(13 {(top + bottom) / 2:.1f}) rotate(-90)"
    yield f'<text class="tick" transform="{turned}" text-anchor="middle">y, m</text>'
    rectangle = f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'
    yield f'<clipPath id="{name}"><rect {rectangle}/></clipPath>'
    yield from (f'<g clip-path="url(#{name})">', *inside, "</g>", *above)
    yield f'<rect class="frame" {rectangle}/>'


def _grid(value: float) -> str:
    return "grid" if value else "grid origin"


def tick(x: float, y: float, anchor: str, words: str) -> str:
    """A number or a name at an axis."""
    return f'<text class="tick" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{words}</text>'


def at(point: Point, drawn: str) -> str:
    """What is drawn around (0, 0), at a place in pixels."""
    return f'<g transform="translate({point[0]:.1f} {point[1]:.1f})">{drawn}</g>'


def badge(name: str, letter: str) -> str:
    """The mark of the start or the goal, around (0, 0)."""
    return f'<circle class="badge {name}" r="10"/><text class="sign" y="4.5">{letter}</text>'


def path_of(each: Drawn, frame: Frame, coarse: bool = False) -> str:
    """The path of a model's polygons, or with `coarse` of one outline around them; a model without shapes is a small cross."""
    polygons = each.outline.polygons
    if not polygons:
        x, y = frame.pixel(each.outline.center)
        return f"M{x - CROSS:.1f} {y - CROSS:.1f}l8 8m0 -8l-8 8"
    shapes = [convex_hull(np.vstack(polygons))] if coarse else polygons
    corners = (frame.pixels(shape) for shape in shapes)
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in shape) + "Z" for shape in corners)


def written(text: str) -> str:
    """`text` as it stands in an SVG file: it may come from an untrusted one."""
    return escape(plain(text))


# Names: inside large models, beside small ones, never on each other.


def labels(
    models: Sequence[Drawn], wanted: Iterable[int], most: int, frame: Frame, points: Sequence[Point], least: float = 0.0
) -> Iterator[str]:
    """The names of the `most` largest of the `wanted` models that have room for one; none covers the marks at `points`, m.

    Letters have at least the size `least`, pixels, even if a smaller one fits better.
    """
    largest = sorted(wanted, key=lambda index: -models[index].outline.area)[:most]
    names = [shortened(each.model.name, LONGEST_LABEL) for each in models]
    marks = [np.array([x - MARK, y - MARK, x + MARK, y + MARK]) for x, y in map(frame.pixel, points)]
    placed = place_labels(names, [_spot(each, frame) for each in models], largest, frame.box, marks)
    return (_plate(label, max(least, label.size)) for label in placed.values())


def _spot(each: Drawn, frame: Frame) -> Spot:
    if each.outline.polygons:
        return spot(frame.pixels(convex_hull(np.vstack(each.outline.polygons))), frame.box, each.floor)
    around = CROSS * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return spot(frame.pixels(np.array([each.outline.center])) + around, frame.box, False)


def _plate(label: Label, size: float) -> str:
    """A name on its own background, so that outlines and neighbours do not make it hard to read."""
    long, high = 1.04 * label.length * size / label.size + 4, HEIGHT * size
    turn = f" rotate({label.angle:.1f})" if abs(label.angle) > 0.05 else ""
    return (
        f'<g transform="translate({label.x:.1f} {label.y:.1f}){turn}">'
        f'<rect class="plate" x="{-long / 2:.1f}" y="{-high / 2:.1f}" width="{long:.1f}" height="{high:.1f}" rx="2"/>'
        f'<text class="label" y="{0.35 * size:.1f}" font-size="{size:g}">{written(label.text)}</text></g>'
    )


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """A drawn model: its `box` (left, top, right, bottom), and a rectangle inside it, `along` x `across`, turned by `angle`.

    Angles are in degrees, clockwise. A `floor` has other models on it.
    """

    box: np.ndarray
    along: float
    across: float
    angle: float
    floor: bool


@dataclass(frozen=True, slots=True)
class Label:
    """`text` around the middle (x, y), turned by `angle` degrees, clockwise; `inside` the model or beside it."""

    text: str
    x: float
    y: float
    size: float
    angle: float
    inside: bool

    @property
    def length(self) -> float:
        """The approximate length of the text."""
        return width(self.text) * WIDTH * self.size

    @property
    def box(self) -> np.ndarray:
        """Left, top, right and bottom."""
        long, high = self.length, HEIGHT * self.size
        cosine, sine = abs(math.cos(math.radians(self.angle))), abs(math.sin(math.radians(self.angle)))
        across, down = (long * cosine + high * sine) / 2, (long * sine + high * cosine) / 2
        return np.array([self.x - across, self.y - down, self.x + across, self.y + down])


def spot(outline: np.ndarray, frame: np.ndarray, floor: bool) -> Spot:
    """The spot of a convex outline (N, 2), cut to `frame`."""
    box = np.clip(
        np.concatenate([outline.min(axis=0), outline.max(axis=0)]), np.tile(frame[:2], 2), np.tile(frame[2:], 2)
    )
    sides = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(sides, axis=1)
    dx, dy = sides[lengths.argmax()]
    # Names on round models are horizontal.
    angle = math.atan2(dy, dx) if lengths.max() > 0.4 * np.ptp(outline, axis=0).max() else 0.0
    angle = _upright(math.degrees(angle))
    if floor:
        along, across = (box[2:] - box[:2]).tolist()
        return Spot(box, along, across, 0.0, floor)
    turn = math.radians(angle)
    along = float(np.ptp(outline @ (math.cos(turn), math.sin(turn))))
    return Spot(box, along, float(np.ptp(outline @ (-math.sin(turn), math.cos(turn)))), angle, floor)


def _upright(angle: float) -> float:
    """The same line in -95 .. 85 degrees, so that no text is upside down and vertical text reads upwards."""
    return (angle + 95) % 180 - 95


def place_labels(
    names: Sequence[str],
    spots: Sequence[Spot],
    wanted: Sequence[int],
    frame: np.ndarray,
    taken: Sequence[np.ndarray] = (),
) -> dict[int, Label]:
    """Labels for those of the `wanted` models that have room for one, placed in that order.

    `spots` are all models in the order of drawing, `frame` is left, top, right and bottom of the drawing; no label covers
    the `taken` boxes.
    """
    occupied = list(taken)
    boxes = np.array([each.box for each in spots]).reshape(-1, 4)
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    solid = np.array([not each.floor for each in spots], dtype=bool)
    placed = {}
    for index in wanted:
        others = solid.copy()
        others[index] = False
        # Models drawn earlier lie below.
        above = others & (np.arange(len(boxes)) > index)
        small = areas < LARGE * width(names[index]) * WIDTH * HEIGHT * SIZES[-1] ** 2
        label = _best(_candidates(names[index], spots[index]), boxes[above], boxes[others & small], frame, occupied)
        if label is not None:
            placed[index] = label
            occupied.append(label.box)
    return placed


def _best(
    candidates: Iterable[Label],
    above: np.ndarray,
    others: np.ndarray,
    frame: np.ndarray,
    occupied: Sequence[np.ndarray],
) -> Label | None:
    """The first label that covers nothing, else the one that covers least; None if all cover too much."""
    best, least = None, MOST_COVERED
    for label in candidates:
        own = label.box
        outside = (own[:2] < frame[:2]).any() or (own[2:] > frame[2:]).any()
        if outside or (occupied and _shared(own, np.array(occupied)).any()):
            continue
        covered = _shared(own, above if label.inside else others).sum() / np.prod(own[2:] - own[:2])
        if covered < least:
            best, least = label, covered
        if covered == 0:
            break
    return best


def _candidates(name: str, spot: Spot) -> Iterator[Label]:
    left, top, right, bottom = spot.box
    x, y = (left + right) / 2, (top + bottom) / 2
    for size in SIZES:
        long, high = width(name) * WIDTH * size + 2 * GAP, HEIGHT * size + 2 * GAP
        if spot.floor and long <= spot.along and high <= spot.across:
            for corner_y in (top + high / 2, bottom - high / 2):
                for corner_x in (left + long / 2, right - long / 2, x):
                    yield Label(name, corner_x, corner_y, size, 0.0, True)
        fits = [(spot.angle, spot.along, spot.across), (_upright(spot.angle + 90), spot.across, spot.along)]
        for angle, room, rest in sorted(fits, key=lambda fit: abs(fit[0]) > 45):
            if long <= room and high <= rest:
                yield Label(name, x, y, size, angle, True)
    for size in SIZES:
        long, high = width(name) * WIDTH * size, HEIGHT * size
        for side in (right + GAP + long / 2, left - GAP - long / 2):
            yield Label(name, side, y, size, 0.0, False)
        for end in (top - GAP - high / 2, bottom + GAP + high / 2):
            yield Label(name, x, end, size, 0.0, False)


def _shared(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The areas of overlap of a box with each of `others` (N, 4)."""
    if not len(others):
        return np.zeros(1)
    sides = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    areas: np.ndarray = np.prod(np.maximum(sides, 0.0), axis=1)
    return areas
