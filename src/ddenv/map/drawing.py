"""What drawings of a world share: which part they show and how large, axes, outlines, marks, and
the names on them.

They have no colours but classes: grid, origin, tick, frame, plate, label, badge, sign.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ddenv.map.raster import extent
from ddenv.text import plain, shortened, width
from ddenv.world.hull import convex_outline
from ddenv.world.pose import Point

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

# Maximum distance outside the page, pixels: some viewers fail on large numbers.
FAR = 1e5
CROSS = 4.0  # half the size of the mark of a model without shapes, pixels
# Of names: the font, pixels; mean width and height of a letter, relative to the font size; space
# around, pixels.
SIZE = 12.0
WIDTH = 0.58
HEIGHT = 1.15
GAP = 3.0
LONGEST_LABEL = 26  # columns
MARK = 14.0  # half the size of a mark, with some space, pixels
MOST_COVERED = 0.3  # maximum fraction of a name that may cover other models
LARGE = (
    10.0  # a model at least this many times larger than a name may carry the name of another model
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """The rectangle from `low` to `high`, m, drawn with `scale` pixels per m at `left` and `top` on
    the page, pixels.
    """

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
        """As large as `most` (pixels) allows, with all `points` and models but huge ones, and at
        least `least` m along each axis.

        The `margin` is a part of the longer side. The drawing fills at least `room` (pixels), and
        begins `at` left, top.
        """
        low, high = extent([each.outline for each in models], points)
        aside = np.maximum(max(0.3, margin * float(max(high - low))), (least - (high - low)) / 2)
        low = low - aside
        high = high + aside
        scale = float(min(most / (high - low)))
        sides = np.maximum(high - low, np.array(room) / scale)
        center = (low + high) / 2
        left, top = at
        return cls(low=center - sides / 2, high=center + sides / 2, scale=scale, left=left, top=top)

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
        x, y = self.pixels(np.array([point]))[0].tolist()
        return x, y


def tick_step(span: float, most: int) -> float:
    """The smallest of 1, 2, 5, 10, 20 ... (and 0.5, 0.2, 0.1 ...) m of which `most` or fewer fit
    into `span` m.
    """
    least = span / max(1, most)
    if not (math.isfinite(least) and least > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(
        power * factor for factor in (1, 2, 5, 10, 20) if power * factor >= least * (1 - 1e-9)
    )


def ticks(low: float, high: float, step: float) -> list[float]:
    """The multiples of `step` from `low` to `high`, m."""
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    # Adding zero turns -0.0 into 0.0.
    return [number * step + 0.0 for number in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """`value` with as many decimals as `step` needs."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{value:.{decimals}f}"


def plot(
    frame: Frame, most: int, name: str, inside: Iterable[str], above: Iterable[str]
) -> Iterator[str]:
    """A map in its axes: what is `inside` is cut off at its frame, names and marks `above` it are
    not.

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
    rectangle = (
        f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'
    )
    yield f'<clipPath id="{name}"><rect {rectangle}/></clipPath>'
    yield from (f'<g clip-path="url(#{name})">', *inside, "</g>", *above)
    yield f'<rect class="frame" {rectangle}/>'


def _grid(value: float) -> str:
    if value:
        return "grid"
    return "grid origin"


def tick(x: float, y: float, anchor: str, words: str) -> str:
    return f'<text class="tick" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{words}</text>'


def at(point: Point, drawn: str) -> str:
    """What is drawn around (0, 0), at a place in pixels."""
    return f'<g transform="translate({point[0]:.1f} {point[1]:.1f})">{drawn}</g>'


def badge(name: str, letter: str) -> str:
    return f'<circle class="badge {name}" r="10"/><text class="sign" y="4.5">{letter}</text>'


def path_of(each: Drawn, frame: Frame, coarse: bool = False) -> str:
    """The path of a model's polygons; with none it is a small cross. With `coarse` it is one
    outline around what is not hollow.
    """
    polygons = each.outline.polygons
    if not polygons:
        x, y = frame.pixel(each.outline.center)
        return f"M{x - CROSS:.1f} {y - CROSS:.1f}l8 8m0 -8l-8 8"
    if coarse and not each.outline.hollow:
        polygons = (convex_outline(np.vstack(polygons)),)
    corners = (frame.pixels(polygon) for polygon in polygons)
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in shape) + "Z" for shape in corners)


def written(text: str) -> str:
    """`text` as it stands in an SVG file: it may come from an untrusted one."""
    return escape(plain(text))


# Names: inside large models, beside small ones, never on each other.


def labels(
    models: Sequence[Drawn],
    wanted: Iterable[int],
    most: int,
    frame: Frame,
    points: Sequence[Point],
    size: float = SIZE,
) -> Iterator[str]:
    """The names of the `most` largest of the `wanted` models that have room for one; none covers
    the marks at `points`, m.
    """
    largest = sorted(wanted, key=lambda index: -models[index].outline.area)[:most]
    names = {index: shortened(models[index].model.name, LONGEST_LABEL) for index in largest}
    left, top, right, bottom = frame.box
    # The models' boxes on the page, as far as they are on the map.
    boxes = np.zeros((len(models), 4))
    for box, each in zip(boxes, models, strict=True):
        corners = frame.pixels(np.array([each.outline.low, each.outline.high]))
        around = 0.0 if each.outline.polygons else CROSS
        box[:2] = np.clip(corners.min(axis=0) - around, (left, top), (right, bottom))
        box[2:] = np.clip(corners.max(axis=0) + around, (left, top), (right, bottom))
    floors = np.array([each.floor for each in models], dtype=bool)
    marks = [
        np.array([x - MARK, y - MARK, x + MARK, y + MARK]) for x, y in map(frame.pixel, points)
    ]
    for index, box in place_labels(names, boxes, floors, frame.box, marks, size).items():
        long, high = box[2:] - box[:2]
        # On its own background, so that outlines and neighbours do not make it hard to read.
        plate = f'x="{-long / 2:.1f}" y="{-high / 2:.1f}" width="{long:.1f}" height="{high:.1f}"'
        label = f'y="{0.35 * size:.1f}" font-size="{size:g}">{written(names[index])}'
        x, y = ((box[:2] + box[2:]) / 2).tolist()
        yield at((x, y), f'<rect class="plate" {plate} rx="2"/><text class="label" {label}</text>')


def place_labels(
    names: Mapping[int, str],
    boxes: np.ndarray,
    floors: np.ndarray,
    frame: np.ndarray,
    taken: Sequence[np.ndarray] = (),
    size: float = SIZE,
) -> dict[int, np.ndarray]:
    """The boxes of those names, by the numbers of their models, that have room for one, placed in
    that order.

    `boxes` (N, 4) are of all models, `floors` (N,) have other models on them. All boxes are left,
    top, right and bottom, pixels, as is the `frame` of the drawing. No label covers the `taken`
    ones.
    """
    occupied = list(taken)
    placed = dict[int, np.ndarray]()
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    for index, name in names.items():
        long = width(name) * WIDTH * size + 2 * GAP
        high = HEIGHT * size + GAP
        # Large models may carry the names of others.
        others = ~floors & (areas < LARGE * long * high)
        others[index] = False
        for box in _places(boxes[index], long, high, bool(floors[index])):
            outside = (box[:2] < frame[:2]).any() or (box[2:] > frame[2:]).any()
            if outside or _shared(box, np.array(occupied).reshape(-1, 4)).any():
                continue
            if _shared(box, boxes[others]).sum() <= MOST_COVERED * long * high:
                placed[index] = box
                occupied.append(box)
                break
    return placed


def _places(box: np.ndarray, long: float, high: float, floor: bool) -> Iterator[np.ndarray]:
    """Where a name of this size may stand: in the middle of its model or in the corners of a floor,
    else beside it.
    """
    left, top, right, bottom = box.tolist()
    x = (left + right) / 2
    y = (top + bottom) / 2
    middles = [
        (right + long / 2, y),
        (left - long / 2, y),
        (x, top - high / 2),
        (x, bottom + high / 2),
    ]
    if long <= right - left and high <= bottom - top:
        corners = [
            (side, end)
            for end in (top + high / 2, bottom - high / 2)
            for side in (left + long / 2, right - long / 2)
        ]
        middles = [*(corners if floor else ()), (x, y), *middles]
    for middle_x, middle_y in middles:
        yield np.array(
            [middle_x - long / 2, middle_y - high / 2, middle_x + long / 2, middle_y + high / 2]
        )


def _shared(box: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The areas of overlap of a box with each of `others` (N, 4)."""
    sides = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    areas: np.ndarray = np.prod(np.maximum(sides, 0.0), axis=1)
    return areas
