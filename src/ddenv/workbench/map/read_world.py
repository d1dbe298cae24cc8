"""The world of a run for the maps of a screen, read beside it: what that needs takes long to load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.workbench.map.place import Place, place_of_run
from ddenv.workbench.shared.background import call_if_open


def read_world(screen: Screen[Any], run: Path, show: Callable[[Place, str], None]) -> None:
    """Calls `show` with the place, and with what is wrong with it, once it is read in a thread. The first paint comes before."""

    def read() -> None:
        try:
            place, notice = place_of_run(run), ""
        except UserError as error:
            place, notice = Place(), str(error)
        call_if_open(screen, show, place, notice)

    screen.call_after_refresh(screen.run_worker, read, thread=True, group="world", exclusive=True)
