"""Why what is left makes the robot fail: what happens without each model, in words and on a map, from the certificate's runs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ddenv.claims import current, rate
from ddenv.page.blocks import Block, Picture, Section, plain, say
from ddenv.report.report_map import CORNERS, two_ways
from ddenv.report.run_data import Record
from ddenv.runs.reasons import Reason, parting_sentence, sentence
from ddenv.words import count

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

# The maximum number of models with a sentence, and of those with a map.
MOST_MODELS, MOST_MAPS = 200, 6


def why(record: Record) -> Section | None:
    """The section on why the robot fails; None before a certificate shows it."""
    found = current(record.state)
    if found is None or not record.reasons:
        return None
    drawn: tuple[Drawn, ...] = ()
    if record.world is not None:
        from ddenv.map.footprints import plan

        drawn = plan(record.world, CORNERS)
    left = count(len(record.state.environment), "model")
    blocks: list[Block] = [say(f"With what is left ({left}): {rate(found.claims[0])}.")]
    for number, reason in enumerate(record.reasons[:MOST_MODELS]):
        blocks.append(say(plain(f"{sentence(reason)} {parting_sentence(reason)}".rstrip())))
        if drawn and number < MOST_MAPS and reason.parting is not None:
            blocks.append(_map(record, drawn, reason, f"why{number}"))
    return Section("Why it fails", tuple(blocks))


def _map(record: Record, drawn: tuple[Drawn, ...], reason: Reason, name: str) -> Picture:
    one = reason.parting
    assert one is not None
    ways = {"with": record.ways[one.with_test], "without": record.ways[one.without_test]}
    there = replace(record, kept=record.kept - frozenset(reason.gone))
    words = f"The world from above without {reason.without}: the robot's paths with it and without it, seed {one.seed}."
    return Picture(name, two_ways(there, drawn, ways, name), plain(words))
