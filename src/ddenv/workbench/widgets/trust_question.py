"""Asks whether a program that a scenario or a run brings along may start."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from textual.app import App

from ddenv.text import plain

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario


def once_trusted(app: App[Any], scenario: Scenario, where: Path, then: Callable[[bool], None]) -> None:
    """Calls `then` with whether the user trusts what `scenario` (of the file `where`) starts; asks only where that is not known."""
    from ddenv.runs.trust import trust, untrusted

    program = untrusted(scenario)
    if program is None:
        then(True)
        return
    from ddenv.workbench.widgets.question import Question

    def answered(yes: bool | None) -> None:
        if yes:
            trust(program)
        then(bool(yes))

    app.push_screen(Question(plain(f"{where} starts {program.words}. Do you trust it?"), final=True), answered)
