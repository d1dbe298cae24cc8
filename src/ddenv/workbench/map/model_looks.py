"""How each model is drawn on the map: its part of the environment, and whether it is kept, left
out, removed or protected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import repeat
from typing import TYPE_CHECKING

import numpy as np

from ddenv.evidence.slices import in_last
from ddenv.map.cells import Signs
from ddenv.map.colors import HUES
from ddenv.map.footprints import FLOOR_AREA
from ddenv.map.paint import Canvas
from ddenv.map.raster import EMPTY
from ddenv.runfile.state import partition_letter
from ddenv.runfile.supports import drops
from ddenv.text import Names
from ddenv.words.signs import DROPS
from ddenv.workbench.map.map_colors import (
    FLOOR,
    FLOOR_OUT,
    KEPT,
    LEFT_OUT,
    PINNED,
    PROTECTED,
    REMOVED,
    SELECTED,
    SOLID,
    Palette,
    Tone,
)
from ddenv.workbench.map.map_words import sensed_order
from ddenv.workbench.map.place import Shown

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

GONE = ord("·")
# A model this many times larger than the median counts as a floor under others.
FLOOR_FACTOR = 8.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Looks:
    """One entry per footprint: `kinds` (KEPT ... SELECTED), `tones` as indices into `looks`, and
    what stands on it in `signs`.
    """

    kinds: np.ndarray
    tones: np.ndarray
    looks: tuple[Tone, ...]
    palette: Palette
    signs: Signs


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """Who is in the environment, and the number of each model's part.

    `shown` are the models of the candidate looked at, `dropped` those of them that lose what they
    rest on.
    """

    elements: frozenset[str] = frozenset()
    environment: frozenset[str] = frozenset()
    shown: frozenset[str] | None = None
    dropped: frozenset[str] = frozenset()
    parts: dict[str, int] = field(default_factory=dict)
    pinned: frozenset[str] = frozenset()
    selected: frozenset[str] = frozenset()
    sensed: dict[str, int] = field(default_factory=dict)


def kept(shown: Shown) -> Kept:
    """What the map needs of a run's state, and how models stand out in the layers that are
    shown.
    """
    state = shown.snapshot.state
    layers = shown.layers
    candidate = shown.candidate
    place = shown.place
    met = in_last(state) if "participants" in layers else None
    standing = frozenset(candidate.models) if candidate else None
    return Kept(
        elements=frozenset(state.elements) or place.elements,
        environment=frozenset(state.environment) if state.elements else place.elements,
        shown=standing if met is None else frozenset(met.names(state.elements)),
        dropped=frozenset(drops(state, candidate)) if candidate else frozenset(),
        parts=state.round.split.letter_of if state.round and "partitions" in layers else {},
        pinned=state.pinned if "pinned" in layers else frozenset(),
        selected=shown.selection,
        sensed=sensed_order(state) if "sensed" in layers else {},
    )


def looks(prints: Sequence[Footprint], who: Kept, palette: Palette) -> Looks:
    names, floor = _known(tuple(prints))
    kinds = np.where(floor, FLOOR, KEPT)
    if who.shown is not None:
        out = ~_among(names, who.shown)
        kinds[out] = np.where(floor, FLOOR_OUT, LEFT_OUT)[out]
    kinds[_among(names, who.pinned)] = PINNED
    kinds[_among(names, who.selected)] = SELECTED
    kinds[~_among(names, who.environment)] = REMOVED
    kinds[~_among(names, who.elements)] = PROTECTED
    parts = np.fromiter(map(who.parts.get, names, repeat(-1)), dtype=int, count=len(names))
    # Only some of many parts look different, and only these colours are mixed.
    short = np.where(parts < 0, -1, parts % len(HUES))
    found, tones = np.unique(kinds * (len(HUES) + 1) + short + 1, return_inverse=True)
    mixes = [divmod(value, len(HUES) + 1) for value in found.tolist()]
    alike = tuple(palette.tone(kind, part - 1) for kind, part in mixes)
    return Looks(
        kinds=kinds,
        tones=tones.astype(np.int32),
        looks=alike,
        palette=palette,
        signs=_signs(names, kinds, parts, who),
    )


@lru_cache(maxsize=4)
def _known(prints: tuple[Footprint, ...]) -> tuple[Names, np.ndarray]:
    areas = np.array([each.area for each in prints])
    if len(areas):
        large = areas > max(FLOOR_AREA, FLOOR_FACTOR * float(np.median(areas)))
    else:
        large = areas > 0
    hollow = np.array([each.hollow for each in prints], dtype=bool)
    return tuple(each.name for each in prints), large & ~hollow


def _signs(names: Names, kinds: np.ndarray, parts: np.ndarray, who: Kept) -> Signs:
    """A letter for each model of a part, with its number in the order of sensing if that is shown,
    and whether it drops.
    """
    several = int(parts.max(initial=-1)) + 2
    groups = kinds * several + parts + 1
    found, which = np.unique(groups, return_inverse=True)
    letters = []
    for kind, part in (divmod(value, several) for value in found.tolist()):
        letter = partition_letter(part - 1) if part else ""
        forms = {PROTECTED: "#", PINNED: "+", REMOVED: "", SELECTED: f"*{letter}"}
        letters.append(forms.get(kind, letter.lower() if kind in (LEFT_OUT, FLOOR_OUT) else letter))
    texts = [letters[number] for number in which.tolist()]
    rank = np.zeros(len(names))
    if who.sensed:
        order = [who.sensed.get(name, 0) for name in names]
        rank = np.where(np.array(order) > 0, order, math.inf)
        texts = [
            f"{text}{number}" if number else text for text, number in zip(texts, order, strict=True)
        ]
    falling = _among(names, who.dropped)
    for number in np.flatnonzero(falling).tolist():
        texts[number] = f"{DROPS}{texts[number]}"
    return Signs(texts, groups, rank, np.isin(kinds, (PINNED, SELECTED)) | falling)


# The world and what is left of it stay the same while the user looks at one candidate after the
# other.
@lru_cache(maxsize=8)
def _among(names: Names, those: frozenset[str]) -> np.ndarray:
    if not those:
        return np.zeros(len(names), dtype=bool)
    return np.fromiter(map(those.__contains__, names), dtype=bool, count=len(names))


def fill(canvas: Canvas, grid: np.ndarray, how: Looks) -> None:
    """Draws the models of an owner grid (two pixels a cell) as half blocks, with seams between
    those that look alike.
    """
    if not len(how.kinds) or not canvas.back.size:
        return
    # The last entry of each stands for EMPTY, which is -1.
    assert EMPTY == -1
    ground = how.palette.back
    tone = np.append(how.tones, len(how.looks))
    fills = np.array([*(each.fill for each in how.looks), ground], dtype=np.int32)
    inks = np.array([*(each.ink for each in how.looks), ground], dtype=np.int32)
    glyphs = np.array(
        [ord(char) for char in (*(each.glyph for each in how.looks), " ")], dtype=np.uint32
    )
    upper = tone[grid[0::2]]
    lower = tone[grid[1::2]]
    whole = upper == lower
    canvas.chars[:] = np.where(whole, glyphs[upper], ord("▀"))
    canvas.fore[:] = np.where(whole, inks[upper], fills[upper])
    canvas.back[:] = np.where(whole, fills[upper], fills[lower])
    # The terminal's own colour can only be the background of a block.
    under = ~whole & (grid[0::2] == EMPTY)
    canvas.chars[under] = ord("▄")
    canvas.fore[under] = fills[lower[under]]
    canvas.back[under] = ground
    _seams(canvas, grid, tone, how)


def _seams(canvas: Canvas, grid: np.ndarray, tone: np.ndarray, how: Looks) -> None:
    pixels = tone[grid]
    beside = np.zeros(grid.shape, dtype=bool)
    above = np.zeros(grid.shape, dtype=bool)
    beside[:, :-1] = (pixels[:, :-1] == pixels[:, 1:]) & (grid[:, :-1] != grid[:, 1:])
    above[1:] = (pixels[:-1] == pixels[1:]) & (grid[:-1] != grid[1:])
    solid = np.array([*(each.glyph != " " for each in how.looks), False])
    seams = np.array([*(each.seam for each in how.looks), 0], dtype=np.int32)
    fills = np.array([*(each.fill for each in how.looks), 0], dtype=np.int32)
    upper = pixels[0::2]
    lower = pixels[1::2]
    full = solid[upper] & (upper == lower)
    # The background of a full block is invisible: one style for all makes a row of few pieces of
    # text.
    block = full & (canvas.chars == ord("█"))
    canvas.back[block] = seams[upper[block]]
    for where, char in ((above[0::2], "▇"), (beside[0::2] | beside[1::2], "▉")):
        canvas.chars[where & block] = ord(char)
    halved = full & above[1::2]
    canvas.chars[halved] = ord("─")
    canvas.fore[halved] = seams[upper[halved]]
    canvas.back[halved] = fills[upper[halved]]
    # Between protected platforms, too: a gap between them may be narrower than a pixel, and what
    # the failure is about.
    protected = canvas.chars == ord(SOLID[PROTECTED])
    for where, line in ((above[0::2], "▔"), (beside[0::2] | beside[1::2], "▕")):
        canvas.chars[where & protected] = ord(line)


def ghosts(
    canvas: Canvas, removed: np.ndarray, grid: np.ndarray, how: Looks, color: int
) -> np.ndarray:
    """Dots at removed models: `removed` is their owner grid. Of the kept models they hide only
    floors.

    Returns which cells have dots, shape (rows, columns).
    """
    if not len(how.kinds):
        return np.zeros(canvas.chars.shape, dtype=bool)
    solid = np.append(~np.isin(how.kinds, (FLOOR, FLOOR_OUT, PROTECTED, REMOVED)), False)
    gone: np.ndarray = np.maximum(removed[0::2], removed[1::2]) != EMPTY
    gone &= ~solid[grid[0::2]] & ~solid[grid[1::2]]
    # The floor around a dot stays whole, also where it fills only half of the cell.
    under = np.maximum(grid[0::2], grid[1::2])[gone]
    fills = np.array([*(each.fill for each in how.looks), how.palette.back], dtype=np.int32)
    canvas.back[gone] = fills[np.append(how.tones, len(how.looks))[under]]
    canvas.chars[gone] = GONE
    canvas.fore[gone] = color
    return gone
