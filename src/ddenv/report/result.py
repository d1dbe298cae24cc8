"""What is left of the world, on a map and model by model, and why the robot fails: in words and on
maps, what happens without each model that is left, what the nearest world that passes lacks, and
how far numbers may change.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from ddenv.evidence.claims import current
from ddenv.map.footprints import Drawn
from ddenv.page.blocks import Block, Cell, Name, Picture, Section, Strong, Table, named, say
from ddenv.report.report_map import picture
from ddenv.report.run_data import Record
from ddenv.runfile.supports import drops_without
from ddenv.runs.reasons import Divergence, no_reasons, parting_sentence, sentence
from ddenv.text import coordinates, count, first_of, plain
from ddenv.words.claims import rate
from ddenv.words.margins import HEAD, rows, said

# The maximum number of models in the table and with a sentence, of names in a list, of those that a
# removal drops, and of maps.
MOST_MODELS = 200
MOST_NAMES = 12
MOST_DROPPED = 3
MOST_MAPS = 6


def what_is_left(record: Record) -> Section:
    state = record.state
    title = "The minimal environment" if state.certified else "What is left so far"
    words = (
        f"The world from above: {count(len(state.environment), 'model')} left, drawn solid; what "
        "was removed is faint. "
        "The robot's paths in f and in the last similar run."
    )
    left = say(Strong("Left:"), " ", *named(state.environment, MOST_MODELS), ".")
    none = "No map: the world cannot be read."
    if state.baseline is None:
        title = "The world"
        words = "The world from above."
        left = say(f"{count(len(state.elements), 'model')} can be removed. {none}")
    if record.world is None:
        return Section(title, (left,) if state.baseline is None else (left, say(none)))
    models = () if state.baseline is None else _models(record)
    return Section(title, (Picture("map", picture(record), words), *models))


def _models(record: Record) -> list[Block]:
    state = record.state
    names = record.state.environment[:MOST_MODELS]
    if not names:
        return []
    by_name = {each.model.name: each for each in record.models}
    drawn = [by_name.get(name) for name in names]
    columns: dict[str, list[Cell]] = {
        "model": [
            (Name(name), " (pinned)") if name in state.pinned else Name(name) for name in names
        ],
        "kind": ["" if each is None else _kind(each) for each in drawn],
        "centre x, y, z, m": ["" if each is None else coordinates(each.center) for each in drawn],
        "size x × y × z, m": ["" if each is None else _size(each) for each in drawn],
    }
    # In the last similar run, s; old files do not say it.
    test = state.evidence_test
    if (
        test is not None
        and 0 < test <= len(state.tests)
        and (first := dict(state.test(test).first_touched))
    ):
        columns["first touched, s"] = [
            f"{first[name]:.1f}" if name in first else "never" for name in names
        ]
    right = range(2, len(columns))
    carried = [drops_without(state, frozenset({name})) for name in names]
    if any(carried):
        columns["removing it drops"] = [named(fallen, MOST_DROPPED) for fallen in carried]
    table = Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), right)
    more = len(state.environment) - len(names)
    if more:
        return [table, say(f"And {count(more, 'more model')}.")]
    return [table]


def _kind(each: Drawn) -> str:
    return "static" if each.model.static else "dynamic"


def _size(each: Drawn) -> str:
    if each.outline.polygons:
        return " × ".join(f"{part:.2f}" for part in each.size)
    return "no shapes"


def why(record: Record) -> Section | None:
    """The section on why the robot fails; None before a certificate or an isolation shows it."""
    found = current(record.state)
    if found is None and record.nearest is None:
        return None
    blocks: list[Block] = []
    if found is not None and len(found.claims) == 1:
        blocks.append(say(plain(no_reasons(found))))
    elif found is not None and record.reasons:
        left = count(len(record.state.environment), "model")
        blocks.append(say(f"With what is left ({left}): {rate(found.claims[0])}."))
    for number, reason in enumerate(record.reasons[:MOST_MODELS]):
        blocks.append(say(plain(f"{sentence(reason)} {parting_sentence(reason)}".rstrip())))
        if record.models and number < MOST_MAPS and reason.parting is not None:
            words = (
                f"The world from above without {reason.without}: the robot's paths with it and "
                "without it"
            )
            blocks.append(
                _map(record, record.kept, reason.gone, reason.parting, f"why{number}", words, None)
            )
    if (passes := record.nearest) is not None:
        blocks.append(say(plain(passes.sentences)))
        if record.models and passes.parting is not None:
            without = f"the robot's path with {first_of(passes.gone, 3)} and without"
            words = f"The nearest world that passes, from above: {without}"
            blocks.append(
                _map(
                    record,
                    record.elements,
                    passes.gone,
                    passes.parting,
                    "nearest",
                    words,
                    passes.gone,
                )
            )
    if blocks:
        return Section("Why it fails", tuple(blocks))
    return None


def margins(record: Record) -> Section | None:
    """The section on how far numbers may change; None where no value was tried."""
    known = record.state.margins
    if known is None or not (found := rows(known)):
        return None
    table = Table(HEAD, tuple((Name(one.cells[0]), *one.cells[1:]) for one in found), {1, 4})
    blocks: list[Block] = [table, *(say(plain(words)) for words in said(known))]
    if record.models and record.changes:
        blocks += _limits(record)
    return Section("Margins", tuple(blocks))


def _limits(record: Record) -> tuple[Block, Block]:
    """What is left with the outlines of all limits, and two ways of the smallest change to the goal
    that can be compared.
    """
    compared = [(one, one.parting) for one in record.changes if one.parting is not None]
    words = "How far each model may move before f disappears."
    ways = {}
    if compared:
        one, parting = min(compared, key=lambda each: (each[0].verdict != "goal", each[0].share))
        ways = {"now": record.ways[parting.with_test], "changed": record.ways[parting.without_test]}
        words += (
            f" The robot's paths now and with {one.name} = {one.value:.4g}, seed {parting.seed}."
        )
    limits = [limit for one in record.changes for limit in one.limits]
    return say(plain(words)), Picture(
        "margins", picture(record, "margins", ways, None, limits), plain(words)
    )


def _map(
    record: Record,
    kept: frozenset[str],
    gone: Collection[str],
    one: Divergence,
    name: str,
    words: str,
    named: Collection[str] | None,
) -> Picture:
    """The world of the models `kept` without those `gone`, with two diverging paths; `named` models
    bear their names.
    """
    ways = {"with": record.ways[one.with_test], "without": record.ways[one.without_test]}
    drawn = picture(replace(record, kept=kept - frozenset(gone)), name, ways, named)
    return Picture(name, drawn, plain(f"{words}, seed {one.seed}."))
