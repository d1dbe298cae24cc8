"""What is left of the world: a map, and each model with its place and size."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ddenv.page.blocks import Block, Cell, Name, Picture, Section, Strong, Table, named, place, say
from ddenv.report.report_map import CORNERS, close_up, picture
from ddenv.report.run_data import Record
from ddenv.runfile.state import RunState
from ddenv.runfile.supports import drops_without
from ddenv.text import count
from ddenv.world.model import is_ground

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

# The maximum number of models in the table, of names in a list, and of those that a removal drops.
MOST_MODELS, MOST_NAMES, MOST_DROPPED = 200, 12, 3


def what_is_left(record: Record) -> Section:
    """The section on what is left."""
    state = record.state
    title = "The minimal environment" if state.certified else "What is left so far"
    if state.baseline is None:
        title = "The world"
    if record.world is None:
        return Section(title, _names_alone(state))
    from ddenv.map.footprints import plan

    drawn = plan(record.world, CORNERS)
    blocks: list[Block] = [Picture("map", picture(record, drawn), _alternative(state))]
    if near := close_up(record, drawn):
        blocks += [
            say("Where the robot failed, closer:"),
            Picture("near", near, "A closer look at where the robot failed."),
        ]
    if state.baseline is not None:
        blocks += _models(state, drawn)
    blocks += _stay(record)
    return Section(title, tuple(blocks))


def _alternative(state: RunState) -> str:
    if state.baseline is None:
        return "The world from above."
    return (
        f"The world from above: {count(len(state.environment), 'model')} left, drawn solid; what was removed is faint. "
        "The robot's paths in f and in the last similar run."
    )


def _models(state: RunState, drawn: tuple[Drawn, ...]) -> list[Block]:
    """A row for each model that is left, in the file's order."""
    by_name = {each.model.name: each for each in drawn}
    touched = _touched(state)
    names = state.environment
    carried = {name: drops_without(state, frozenset({name})) for name in names[:MOST_MODELS]}
    drop = any(carried.values())
    rows = tuple(
        (*_row(name, by_name.get(name), touched, state), *((named(fallen, MOST_DROPPED),) if drop else ()))
        for name, fallen in carried.items()
    )
    if not rows:
        return []
    head = ["model", "kind", "centre x, y, z, m", "size x × y × z, m"]
    head += (["first touched, s"] if touched else []) + (["removing it drops"] if drop else [])
    table = Table(tuple(head), rows, frozenset({2, 3, 4} if touched else {2, 3}))
    more = len(names) - len(rows)
    return [table, say(f"And {count(more, 'more model')}.")] if more else [table]


def _row(name: str, each: Drawn | None, touched: dict[str, float], state: RunState) -> tuple[Cell, ...]:
    shown: Cell = (Name(name), " (pinned)") if name in state.pinned else Name(name)
    if each is None:
        return (shown, "", "", "") + (("",) if touched else ())
    kind = "static" if each.model.static else "dynamic"
    size = " × ".join(f"{part:.2f}" for part in each.size) if each.outline.polygons else "no shapes"
    at = (f"{touched[name]:.1f}" if name in touched else "never",) if touched else ()
    return (shown, kind, place(each.center), size, *at)


def _touched(state: RunState) -> dict[str, float]:
    """When the robot first touched each model in the last similar run, s; empty in old files."""
    test = state.evidence_test
    if test is None or not 0 < test <= len(state.tests):
        return {}
    return dict(state.tests[test - 1].first_touched)


def _stay(record: Record) -> list[Block]:
    """The models that are no elements, and so always stay."""
    elements = frozenset(record.state.elements)
    models = () if record.world is None else record.world.models
    others = [model for model in models if model.name not in elements]
    if not others:
        return []
    grounds = [model.name for model in others if is_ground(model)]
    protected = [model.name for model in others if not is_ground(model)]
    return [say(Strong("Always there:"), " ", *named(grounds + protected, MOST_NAMES), ".")]


def _names_alone(state: RunState) -> tuple[Block, ...]:
    if state.baseline is None:
        return (say(f"{count(len(state.elements), 'model')} can be removed. No map: the world cannot be read."),)
    left = say(Strong("Left:"), " ", *named(state.environment, MOST_MODELS), ".")
    return (left, say("No map: the world cannot be read."))
