"""Places names on a drawing: inside large models, beside small ones, never on each other. Lengths in pixels, y downwards."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ddenv.text import width

SIZES = (12.0, 10.5, 9.0)  # of fonts, the preferred first, pixels
# Mean width and height of a letter, relative to the font size.
WIDTH, HEIGHT = 0.58, 1.15
GAP = 3.0
# Maximum fraction of a name that may cover other models.
MOST_COVERED = 0.3
# A model at least this many times larger than a name may carry the name of another model.
LARGE = 10.0


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
