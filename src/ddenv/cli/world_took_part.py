"""`ddenv world show RUN`: the map of a run's world. Bright are the models that took part in its first runs (`--took-part`), or
those of the nearest world that passes (`--passes`).
"""

from __future__ import annotations

from pathlib import Path

from ddenv.amounts import count
from ddenv.cli.world_show import terminal_map
from ddenv.errors import UserError, printable
from ddenv.evidence.took_part import in_whole_world
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import read_parts
from ddenv.runs.nearest import removed_in_passing


def took_part_map(path: Path, columns: int, rows: int, *, color: bool) -> str:
    """The map, and a line for each model that took part, the most frequent first. Raises UserError where that is unknown."""
    with RunFile(path) as run:
        _, world, _ = read_parts(run)
        state = fold(run.events())
    times, baseline = in_whole_world(state), state.baseline
    if not times or baseline is None:
        raise UserError(f"{path}: it is not recorded what took part in its runs of the whole world; make a new run")
    rest = frozenset(model.name for model in world.models) - times.keys()
    lines = [f"  {printable(name)}: {number} of {count(baseline.runs, 'run')}" for name, number in times.most_common()]
    head = f"{count(len(times), 'model')} of {len(state.elements)} took part in the runs of the whole world:"
    return "\n".join([terminal_map(world, columns, rows, color=color, dim=rest), head, *lines])


def passing_map(path: Path, columns: int, rows: int, *, color: bool) -> str:
    """The map, and a line for each model that has to go. Raises UserError where no world that passes is known."""
    with RunFile(path) as run:
        _, world, _ = read_parts(run)
        state = fold(run.events())
    gone = removed_in_passing(state, path)
    head = f"the nearest world that passes lacks {count(len(gone), 'model')} of {len(state.elements)}:"
    lines = [f"  {printable(name)}" for name in gone]
    return "\n".join([terminal_map(world, columns, rows, color=color, dim=frozenset(gone)), head, *lines])
