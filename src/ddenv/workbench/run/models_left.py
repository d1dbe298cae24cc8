"""The models that are left: the part each is in, how far it is from f, and when the robot first sensed it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Static

from ddenv.runfile.state import RunState, partition_letter
from ddenv.text import padded, shortened
from ddenv.workbench.widgets.lines import Lines

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# Columns behind the name: part, distance, first sensed.
REST = 3 + 9 + 9


class ModelsLeft(Vertical):
    """The list of models; it is filled only while it is in sight."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, classes="panel")
        self.border_title = "Models left"
        self._made_of: tuple[object, ...] = ()

    def compose(self) -> ComposeResult:
        yield Static("", id="models-heading", markup=False)
        yield Lines(line, nothing="none", id="models")

    def show(self, state: RunState, prints: Sequence[Footprint]) -> None:
        """Shows the run as it is now; `prints` are the footprints of its models."""
        split = None if state.round is None or state.round.done else state.round.split
        made_of = (state.environment, split, state.pinned, state.evidence_test, state.baseline, prints)
        lines = self.query_one("#models", Lines)
        same = bool(self._made_of) and all(a is b for a, b in zip(made_of, self._made_of, strict=True))
        if same or not lines.size.width:
            return
        self._made_of = made_of
        self.query_one("#models-heading", Static).update(heading(lines.size.width))
        lines.show(rows(state, prints))


@dataclass(frozen=True, slots=True)
class Row:
    """`part` is its letter, "+" if it is pinned, "" in no part; `stands` its footprint, `f` its end, m; `sensed` in simulated s."""

    name: str
    part: str
    stands: Footprint | None
    f: tuple[float, float] | None
    sensed: float | None


def rows(state: RunState, prints: Sequence[Footprint]) -> tuple[Row, ...]:
    """The models of the environment, those nearest to f first."""
    parts = {name: place for place, part in enumerate(_partitions(state)) for name in part}
    sensed = _sensed(state)
    places = {each.name: each for each in prints}
    f = None if state.f_position is None else state.f_position[:2]
    found = []
    for name in state.environment:
        part = "+" if name in state.pinned else partition_letter(parts[name]) if name in parts else ""
        found.append(Row(name, part, places.get(name), f, sensed.get(name)))
    return tuple(sorted(found, key=_nearly))


def _nearly(row: Row) -> float:
    """How far from f the rectangle around a model is, m: exact distances only for models in sight, of thousands."""
    if row.stands is None or row.f is None:
        return math.inf
    sides = zip(row.stands.low, row.f, row.stands.high, strict=True)
    return math.hypot(*(max(low - at, at - high, 0.0) for low, at, high in sides))


def line(row: Row, width: int) -> Text:
    """A row as text, with the name cut to the room there is."""
    room = max(4, width - REST)
    away = "" if row.stands is None or row.f is None else f"{row.stands.distance(row.f):.1f} m"
    sensed = "never" if row.sensed is None else f"{row.sensed:.1f} s"
    text = Text(padded(shortened(row.name, room), room), no_wrap=True)
    return text.append(f"{row.part:>3}", "bold").append(f"{away:>9}").append(f"{sensed:>9}", "dim")


def heading(width: int) -> str:
    """The names of the columns."""
    return f"{'model':<{max(4, width - REST)}}{'in':>3}{'from f':>9}{'sensed':>9}"


def _partitions(state: RunState) -> tuple[tuple[str, ...], ...]:
    return state.round.partitions if state.round is not None and not state.round.done else ()


def _sensed(state: RunState) -> dict[str, float]:
    test = state.evidence_test
    if test is None or not 0 < test <= len(state.tests):
        return {}
    return dict(state.tests[test - 1].first_sensed)
