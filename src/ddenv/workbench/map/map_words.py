"""The map in words: its legend, and the model under the crosshair."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.text import Text
from textual.widget import Widget

from ddenv.evidence.slices import in_last
from ddenv.runfile.state import RunState, partition_letter
from ddenv.runfile.supports import drops, drops_without
from ddenv.text import count, shortened
from ddenv.words.signs import DROPS, dropping
from ddenv.workbench.map.place import Shown

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

LEGEND = (
    ("S", "start"),
    ("G", "goal"),
    ("×", "end of f"),
    ("·", "removed"),
    ("⠒", "path"),
    ("↗", "robot"),
    ("#", "protected"),
)
# These are shown only where they are on the map.
PARTS, SELECTED, PINNED, FALLING, SENSED, NO_PART, FIRST_PATH = MORE_SIGNS = (
    ("A B", "parts"),
    ("*", "selected"),
    ("+", "pinned"),
    (DROPS, "drops"),
    ("1 2", "order sensed"),
    ("a b", "no effect"),
    ("⠒ ⠒", "path of f"),
)
# On a map of finished tests.
PARTING = "≠"
SOLID, DASHED, ROBOTS, PARTED = OF_WAYS = (
    ("⠒", "the first path"),
    ("⠒ ⠒", "the second path"),
    ("→ ⇒", "their robots"),
    (PARTING, "paths diverge"),
)
LIMITS = ("▭", "limits")
LONGEST_NAME = 40
LONGEST_DROPPED = 16
SHORT_DROPPED = 10
# The first signs of `LEGEND` are places, which no map goes without. Two cells apart, they need so
# many cells.
PLACES = 3
GAP = 2
WITH_GAPS = 28


def legend(shown: Shown, width: int, lines: int = 2) -> Text:
    """The signs on the map with their meanings, as many as fit: first where the robot starts, has
    to go and ended.
    """
    state = shown.snapshot.state
    layers = shown.layers
    meanings = {
        PARTS: state.round is not None and "partitions" in layers,
        SELECTED: bool(shown.selection),
        PINNED: bool(state.pinned) and "pinned" in layers,
        FALLING: shown.candidate is not None and bool(drops(state, shown.candidate)),
        SENSED: "sensed" in layers and state.evidence_test is not None,
        NO_PART: "participants" in layers and in_last(state) is not None,
        FIRST_PATH: "original" in layers and not shown.same_paths,
    }
    signs = [sign for sign, there in meanings.items() if there]
    usual = (*LEGEND[:PLACES], *signs, *LEGEND[PLACES:]) if state.elements else LEGEND[:2]
    text = Text(no_wrap=True, overflow="ellipsis")
    used = 0
    gap = GAP if width >= WITH_GAPS else 1
    if shown.ways or shown.limits:
        ways = (
            (sign, way.name) for (sign, _), way in zip((SOLID, DASHED), shown.ways, strict=False)
        )
        rare = (LIMITS if shown.limits else None, PARTED if shown.parting else None, shown.apart)
        usual = (*ways, *filter(None, rare), *(each for each in LEGEND if each[0] in "SG×·#"))
    for sign, meaning in usual:
        cells = len(sign) + 1 + len(meaning)
        if used and used + gap + cells > width:
            lines -= 1
            used = 0
        if not lines or cells > width:
            break
        if text:
            text.append(" " * gap if used else "\n")
        text.append(sign, "bold").append(f" {meaning}", "dim")
        used += (gap if used else 0) + cells
    return text


def sensed_order(state: RunState) -> dict[str, int]:
    return {name: number for number, (name, _) in enumerate(_sensed(state), start=1)}


def _sensed(state: RunState) -> list[tuple[str, float]]:
    test = state.evidence_test
    if test is None or not 0 < test <= len(state.tests):
        return []
    return sorted(state.test(test).first_sensed, key=lambda entry: entry[1])


def describe(state: RunState, each: Footprint, columns: int = 0) -> Text:
    """Name, part, size, distance to f and time first sensed, as much as fits in `columns` (0: all).
    Names are shortened.
    """
    width = each.high[0] - each.low[0]
    depth = each.high[1] - each.low[1]
    shaped = bool(each.polygons) and math.isfinite(width + depth)
    words = [_standing(state, each.name), f"{width:.3g} x {depth:.3g} m" if shaped else "no shapes"]
    if state.f_position is not None:
        words.append(f"{each.distance(state.f_position[:2]):.1f} m from f")
    for number, (name, moment) in enumerate(_sensed(state), start=1):
        if name == each.name:
            words.append(f"sensed at {moment:.1f} s (no. {number})")
    text = Text(
        shortened(each.name, min(LONGEST_NAME, columns or LONGEST_NAME)), "bold", no_wrap=True
    )
    text.append("".join(f" · {word}" for word in words if word), "not bold")
    text.truncate(columns or text.cell_len, overflow="ellipsis")
    return text


def _standing(state: RunState, name: str) -> str:
    if not state.elements:
        return ""
    if name in state.pinned:
        return "pinned"
    if name not in state.elements:
        return "protected"
    if name not in state.environment:
        return "removed"
    part = state.round.split.letter_of.get(name) if state.round else None
    if part is None:
        return "kept"
    return f"part {partition_letter(part)}"


class MapLines(Widget):
    """One line on what is shown, and one of signs; two of signs where nothing is to be said, or
    with `only_signs`.
    """

    def __init__(self, only_signs: bool = False, *, id: str) -> None:
        super().__init__(id=id)
        self._only_signs = only_signs
        self._shown = Shown()

    def show(self, shown: Shown) -> None:
        self._shown = shown
        self.refresh()

    def render(self) -> Text:
        width = self.size.width
        shown = self._shown
        text = Text(no_wrap=True)
        state = shown.snapshot.state
        longest = LONGEST_DROPPED if width > 44 else SHORT_DROPPED
        if self._only_signs:
            return legend(shown, width)
        if shown.selection:
            drop = dropping(drops_without(state, shown.selection), longest)
            text.append(f"{len(shown.selection)} selected{f', w {drop}' if drop else ''}", "bold")
            text.append(": p pin, w try without, o try only", "dim")
        elif shown.candidate is not None:
            drop = dropping(drops(state, shown.candidate), longest)
            text.append(
                f"{shown.candidate.label}: {drop or count(shown.candidate.size, 'model')}", "bold"
            )
            text.append("" if drop else "  others in small letters", "dim")
        else:
            return legend(shown, width)
        text.truncate(width, overflow="ellipsis")
        return text.append("\n").append_text(legend(shown, width, 1))
