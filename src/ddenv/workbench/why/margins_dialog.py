"""Margins in a dialog: each number with a bar of where f shows and where the robot reaches its goal, all on one scale."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding

from ddenv.runfile.state import RunState
from ddenv.text import plain
from ddenv.words.margins import BAR_WORDS, bar, nearest_fix, rows, sureness
from ddenv.workbench.help.shortcuts import Reading

WIDTH = 41


class MarginsDialog(Reading):
    """The margins that `state` has. `run` is what a shell calls the run."""

    BINDINGS: ClassVar = [
        Binding("escape,m,q,enter", "dismiss", "close", id="margins.close", tooltip="close this dialog"),
    ]

    def __init__(self, state: RunState, run: str) -> None:
        known = state.margins
        found = () if known is None else rows(known)
        lines = []
        for one in found:
            name, now, until, goal, runs = map(plain, one.cells)
            lines += [
                (name, bar(one.margin, WIDTH)),
                ("", f"now {now}; f until {until};{'' if goal == '-' else f' then {goal};'} {runs} runs"),
            ]
        groups = [("How far each number may change before f goes", lines)]
        if not lines:
            groups = [
                ("Not looked for yet", [("", f"ddenv margins {plain(run)} finds how far each number may change")])
            ]
        if known is not None and found:
            groups += [
                ("What this says", [("", plain(words)) for words in (nearest_fix(known), sureness(known), BAR_WORDS)])
            ]
        super().__init__("Margins", groups)
