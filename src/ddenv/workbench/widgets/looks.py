"""How each model is drawn on the map: its part of the environment, and whether it is kept, left out, removed or protected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ddenv.map.footprints import Footprint
from ddenv.map.paint import HUES, RGB, Canvas, blend, packed
from ddenv.map.raster import EMPTY
from ddenv.runfile.state import Candidate, RunState, partition_letter

KEPT, FLOOR, LEFT_OUT, FLOOR_OUT, PROTECTED, REMOVED = range(6)
# A full cell of each. Where the terminal has colours, all but the protected ones look solid; without, they tell.
FULL = np.array([ord(char) for char in "█░▓░▒ "], dtype=np.uint32)
GONE = ord("·")
# A model so many times larger than the median is a floor that others stand on.
FLOOR_FACTOR = 8.0
NEUTRAL: RGB = (128, 140, 160)


@dataclass(frozen=True, slots=True)
class Looks:
    """One entry per footprint: `kinds` (KEPT ... REMOVED), packed `fill` and `ink` colours, and its `labels`."""

    kinds: np.ndarray
    fill: np.ndarray
    ink: np.ndarray
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Kept:
    """Who is in the environment: `letters` of each model's part, `shown` the models of the candidate that is looked at."""

    elements: frozenset[str] = frozenset()
    environment: frozenset[str] = frozenset()
    shown: frozenset[str] | None = None
    parts: dict[str, int] = field(default_factory=dict)


def kept(state: RunState, candidate: Candidate | None) -> Kept:
    """What the map needs of a run's state."""
    partitions = state.round.partitions if state.round else ()
    parts = {name: index for index, part in enumerate(partitions) for name in part}
    shown = frozenset(candidate.models) if candidate else None
    return Kept(frozenset(state.elements), frozenset(state.environment), shown, parts)


def looks(prints: Sequence[Footprint], who: Kept, back: RGB, fore: RGB) -> Looks:
    """The looks of all models on a background `back` with text colour `fore`."""
    areas = [each.area for each in prints]
    floor = FLOOR_FACTOR * float(np.median(areas)) if areas else 0.0
    kinds, fills, inks, labels = [], [], [], []
    for index, each in enumerate(prints):
        part = who.parts.get(each.name)
        hue = NEUTRAL if part is None else HUES[part % len(HUES)]
        kind = _kind(each, who, floor)
        # Neighbours of one part are told apart by a slightly different strength.
        strength = {KEPT: 0.80 - 0.16 * (index % 2), FLOOR: 0.26, LEFT_OUT: 0.24, FLOOR_OUT: 0.10}.get(kind, 0.0)
        fill = blend(back, fore, 0.10) if kind == PROTECTED else blend(back, hue, strength)
        ink = blend(back, fore, 0.20) if kind == PROTECTED else fill
        letter = "" if part is None or kind in (PROTECTED, REMOVED) else partition_letter(part)
        kinds.append(kind)
        fills.append(packed(fill))
        inks.append(packed(ink))
        labels.append(letter.lower() if kind in (LEFT_OUT, FLOOR_OUT) else "#" if kind == PROTECTED else letter)
    return Looks(
        np.array(kinds, dtype=int), np.array(fills, dtype=np.int32), np.array(inks, dtype=np.int32), tuple(labels)
    )


def _kind(each: Footprint, who: Kept, floor: float) -> int:
    if each.name not in who.elements:
        return PROTECTED
    if each.name not in who.environment:
        return REMOVED
    if who.shown is not None and each.name not in who.shown:
        return FLOOR_OUT if each.area > floor else LEFT_OUT
    return FLOOR if each.area > floor else KEPT


def fill(canvas: Canvas, grid: np.ndarray, how: Looks) -> None:
    """Draws the models of an owner grid (two pixels a cell) as half blocks."""
    if not len(how.kinds) or not canvas.back.size:
        return
    # The last entry stands for EMPTY, which is -1.
    assert EMPTY == -1
    fills, inks = np.append(how.fill, canvas.back[0, 0]), np.append(how.ink, canvas.back[0, 0])
    full = np.append(FULL[how.kinds], ord(" "))
    top, bottom = grid[0::2], grid[1::2]
    same = (full[top] == full[bottom]) & (fills[top] == fills[bottom])
    canvas.chars[:] = np.where(same, full[top], ord("▀"))
    canvas.fore[:] = np.where(same, inks[top], fills[top])
    canvas.back[:] = fills[bottom]


def ghosts(canvas: Canvas, removed: np.ndarray, grid: np.ndarray, how: Looks, color: int) -> None:
    """Dots where removed models stood: `removed` is their owner grid. They hide nothing that is kept, but floors."""
    if not len(how.kinds):
        return
    solid = np.append((how.kinds == KEPT) | (how.kinds == LEFT_OUT), False)
    gone = (removed[0::2] != EMPTY) & ~solid[grid[0::2]] & ~solid[grid[1::2]]
    canvas.chars[gone] = GONE
    canvas.fore[gone] = color
