"""What the screens of lessons share: their parts, the world of a run on their maps, and any moment
of a search in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from textual.app import ComposeResult
from textual.screen import Screen, ScreenResultType
from textual.widgets import Static

from ddenv.learn.race import Turn
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import PersistentTuple, Round
from ddenv.text import Names
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.place import Place, read_world
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.bindings import ids

SMALLEST = (64, 20)
# With so many models at most, maps have their names from the start.
NAMED = 12


class LearnScreen(Screen[ScreenResultType]):
    """A header, a `body` and the keys; in a terminal that is too small, how large it has to be.

    `NAME` begins the ids of its header and its keys. Its footer has the keys `FIRST`, by priority.
    """

    CSS_PATH = "learn.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (SMALLEST[0], "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-tall")]
    NAME: ClassVar = ""
    FIRST: ClassVar = ""

    def compose(self) -> ComposeResult:
        yield Static("", id=f"{self.NAME}-header", markup=False)
        yield from self.body()
        yield KeyFooter(ids(self.NAME, self.FIRST))
        yield Static(f"ddenv learn needs {SMALLEST[0]} x {SMALLEST[1]}", id="small", markup=False)

    def body(self) -> ComposeResult:
        yield from ()

    def read_world(self, run: Path, maps: Sequence[WorldMap]) -> None:
        def show(place: Place, notice: str) -> None:
            for each in maps:
                each.set_place(place, notice)
                if len(place.elements) <= NAMED and "names" not in each.shown.layers:
                    each.toggle_layer("names")

        read_world(self, run, show)

    def say(self, why: str) -> None:
        self.notify(why, timeout=4, markup=False)

    def action_close(self) -> None:
        """Back; or out, where the command line opened this screen."""
        if len(self.app.screen_stack) > 2:
            self.dismiss(None)
        else:
            self.app.exit(0)


def snapshot_of(base: Snapshot, left: Names, turn: Turn | None = None) -> Snapshot:
    """The run of `base` as if `left` were its environment, with the parts of `turn`."""
    split = None if turn is None else turn.split
    if turn is None or split is None:
        round = None
    else:
        round = Round(
            number=turn.round,
            n_partitions=len(split.partitions),
            split=split,
            candidates=PersistentTuple(),
        )
    return replace(
        base, state=base.state.changed(environment=left, round=round), past=True, pointed=None
    )
