"""Why the robot fails, in words and on maps: what happens without each model that is left, and what the nearest world that passes
lacks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ddenv.evidence.claims import current, rate
from ddenv.page.blocks import Block, Picture, Section, Table, say
from ddenv.report.report_map import CORNERS, picture
from ddenv.report.run_data import Record
from ddenv.runs.nearest import Nearest
from ddenv.runs.reasons import Reason, no_reasons, parting_sentence, sentence
from ddenv.text import count, first_of, plain

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

# The maximum number of models with a sentence, and of those with a map.
MOST_MODELS, MOST_MAPS = 200, 6


def why(record: Record) -> Section | None:
    """The section on why the robot fails; None before a certificate or an isolation shows it."""
    found = current(record.state)
    if found is None and record.nearest is None:
        return None
    drawn: tuple[Drawn, ...] = ()
    if record.world is not None:
        from ddenv.map.footprints import plan

        drawn = plan(record.world, CORNERS)
    blocks: list[Block] = []
    if found is not None and len(found.claims) == 1:
        blocks.append(say(plain(no_reasons(found))))
    elif found is not None and record.reasons:
        left = count(len(record.state.environment), "model")
        blocks.append(say(f"With what is left ({left}): {rate(found.claims[0])}."))
    for number, reason in enumerate(record.reasons[:MOST_MODELS]):
        blocks.append(say(plain(f"{sentence(reason)} {parting_sentence(reason)}".rstrip())))
        if drawn and number < MOST_MAPS and reason.parting is not None:
            blocks.append(_map(record, drawn, reason, f"why{number}"))
    if record.nearest is not None:
        blocks += _passing(record, record.nearest, drawn)
    return Section("Why it fails", tuple(blocks)) if blocks else None


def _passing(record: Record, found: Nearest, drawn: tuple[Drawn, ...]) -> list[Block]:
    """The nearest world that passes, and the two runs side by side."""
    blocks: list[Block] = [say(plain(found.sentences))]
    one = found.parting
    if one is None:
        return blocks
    if drawn:
        ways = {"with": record.ways[one.with_test], "without": record.ways[one.without_test]}
        there = replace(record, kept=record.elements - frozenset(found.gone))
        words = (
            f"The nearest world that passes, from above: the robot's path with {first_of(found.gone, 3)} and without, "
            f"seed {one.seed}."
        )
        blocks.append(Picture("nearest", picture(there, drawn, "nearest", ways, found.gone), plain(words)))
    rows = tuple(
        (f"{each.seconds:.1f}", _place(each.failing), _place(each.passing), f"{each.apart:.2f}")
        for each in found.instants
    )
    head = ("time, s", "whole world: x, y, m", "nearest world that passes: x, y, m", "apart, m")
    return [*blocks, Table(head, rows, frozenset({0, 1, 2, 3}))]


def _place(point: tuple[float, float]) -> str:
    return f"{point[0]:.2f}, {point[1]:.2f}"


def _map(record: Record, drawn: tuple[Drawn, ...], reason: Reason, name: str) -> Picture:
    one = reason.parting
    assert one is not None
    ways = {"with": record.ways[one.with_test], "without": record.ways[one.without_test]}
    there = replace(record, kept=record.kept - frozenset(reason.gone))
    words = f"The world from above without {reason.without}: the robot's paths with it and without it, seed {one.seed}."
    return Picture(name, picture(there, drawn, name, ways), plain(words))
