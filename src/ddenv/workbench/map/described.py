"""What is told of the map in words: its legend, and the model under the crosshair."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from ddenv.map.names import shortened
from ddenv.runfile.state import RunState, partition_letter

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
LONGEST_NAME = 40


def legend(width: int, *, parts: bool = True, extra: Sequence[tuple[str, str]] = ()) -> Text:
    """One line that says what the signs mean, as many as fit in `width`; `extra` signs come before the others."""
    text = Text(no_wrap=True, overflow="ellipsis")
    entries = (("A B", "parts"), *extra, *LEGEND) if parts else (*extra, *LEGEND[:2])
    for sign, meaning in entries:
        if text.cell_len + len(sign) + len(meaning) + 3 > width:
            break
        text.append(f"{sign}", "bold").append(f" {meaning}  ", "dim")
    return text


def sensed_order(state: RunState) -> dict[str, int]:
    """The models that the last similar run sensed, numbered from 1 in the order in which it first did."""
    return {name: number for number, (name, _) in enumerate(_sensed(state), start=1)}


def _sensed(state: RunState) -> list[tuple[str, float]]:
    test = state.evidence_test
    if test is None or not 0 < test <= len(state.tests):
        return []
    return sorted(state.tests[test - 1].first_sensed, key=lambda entry: entry[1])


def describe(state: RunState, each: Footprint, columns: int = 0) -> Text:
    """Name, part, size, distance to f and when it was first sensed, as much as fits in `columns`, or all. Names are shortened."""
    words = [_standing(state, each.name), _size(each)]
    if state.baseline is not None:
        words.append(f"{each.distance(state.baseline.position[:2]):.1f} m from f")
    for number, (name, moment) in enumerate(_sensed(state), start=1):
        if name == each.name:
            words.append(f"sensed at {moment:.1f} s (no. {number})")
    text = Text(shortened(each.name, min(LONGEST_NAME, columns or LONGEST_NAME)), "bold", no_wrap=True)
    for word in filter(None, words):
        if columns and text.cell_len + len(word) + 3 > columns:
            break
        text.append(f" · {word}", "not bold")
    return text


def _size(each: Footprint) -> str:
    width, depth = each.high[0] - each.low[0], each.high[1] - each.low[1]
    if not each.polygons or not math.isfinite(width + depth):
        return "no shapes"
    return f"{width:.3g} x {depth:.3g} m"


def _standing(state: RunState, name: str) -> str:
    """Whether a model is kept, and in which part."""
    if not state.elements:
        return ""
    if name in state.pinned:
        return "pinned"
    if name not in state.elements:
        return "protected"
    if name not in state.environment:
        return "removed"
    partitions = state.round.partitions if state.round else ()
    part = next((index for index, names in enumerate(partitions) if name in names), None)
    return "kept" if part is None else f"part {partition_letter(part)}"
