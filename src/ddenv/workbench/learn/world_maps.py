"""The maps of a lesson's screens: they read the world of a run beside the screen, and show any moment of a search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.learn.race import Turn
from ddenv.runfile.persistent import PersistentTuple
from ddenv.runfile.state import Round
from ddenv.workbench.map.place import Place, place_of_run
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.background import call_if_open
from ddenv.workbench.shared.poll import Snapshot


def read_world(screen: Screen[None], run: Path, maps: Sequence[WorldMap]) -> None:
    """Shows the world of a run on these maps, once it is read in a thread: what that needs takes long to load."""

    def read() -> None:
        try:
            place, notice = place_of_run(run), ""
        except UserError as error:
            place, notice = Place(), str(error)
        for each in maps:
            call_if_open(screen, each.set_place, place, notice)

    screen.run_worker(read, thread=True, group="world", exclusive=True)


def snapshot_of(base: Snapshot, left: tuple[str, ...], turn: Turn | None = None) -> Snapshot:
    """The run of `base` as if `left` were its environment, with the parts of `turn`."""
    split = None if turn is None else turn.split
    round = (
        None if turn is None or split is None else Round(turn.round, len(split.partitions), split, PersistentTuple())
    )
    return replace(base, state=base.state.changed(environment=left, round=round), past=True, pointed=None)
