"""The minimal worlds from above, each once whoever found it: the paper's Figure 3."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ddenv.errors import UserError
from ddenv.report.blocks import Block, Name, Part, Picture, plain, say
from ddenv.report.drawing import CORNERS, picture
from ddenv.report.read import read_run
from ddenv.study.folder import run_path
from ddenv.study.found import Found
from ddenv.study.rows import Group
from ddenv.words import count

# So many worlds of a scenario are drawn, and so many of their models named.
MOST_WORLDS, MOST_NAMES = 4, 12


def worlds(folder: Path, group: Group, file: str) -> Iterator[Block]:
    """A map of each set of models that is left, those that most cells found first; `file` is part of the pictures' names."""
    sets: dict[tuple[str, ...], list[Found]] = {}
    for each in group.minimal:
        sets.setdefault(each.left, []).append(each)
    ranked = sorted(sets.items(), key=lambda one: -len(one[1]))
    for number, (left, cells) in enumerate(ranked[:MOST_WORLDS], start=1):
        yield say(*_said(left, len(cells), len(group.minimal)))
        yield from _map(folder, cells[0], f"figure-3-{file}" + (f".{number}" if len(ranked) > 1 else ""))
    if len(ranked) > MOST_WORLDS:
        yield say(f"And {count(len(ranked) - MOST_WORLDS, 'more minimal world')}, which fewer cells found.")


def _said(left: tuple[str, ...], cells: int, of_them: int) -> Iterator[Part]:
    yield "The minimal world (the paper's Figure 3)"
    yield f", the end of {cells} of {of_them} cells: " if of_them > 1 else ": "
    if not left:
        yield "nothing that can be removed"
    for number, name in enumerate(left[:MOST_NAMES]):
        yield ", " if number else ""
        yield Name(name)
    yield f" and {len(left) - MOST_NAMES} more." if len(left) > MOST_NAMES else "."


def _map(folder: Path, found: Found, name: str) -> Iterator[Block]:
    from ddenv.map.plan import plan

    try:
        record = read_run(run_path(folder, found.cell))
    except UserError as error:
        yield say(f"No map: {plain(error)}", notice=True)
        return
    if record.world is None:
        yield say("No map: the world cannot be read.", notice=True)
        return
    told = (
        f"The world of {plain(found.cell.scenario.name)} from above: what is left is solid, what was removed is faint."
    )
    yield Picture(name, picture(record, plan(record.world, CORNERS), name), told)
