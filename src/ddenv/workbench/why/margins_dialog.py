"""Margins in a dialog: each number with a bar of where f shows and where the robot reaches its goal, all on one scale."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from ddenv.runfile.state import RunState
from ddenv.text import padded, plain, shortened
from ddenv.words.margins import BAR_WORDS, bar, bar_scale, nearest_fix, rows, sureness
from ddenv.workbench.help.hints import Framed

# Of a bar, and of a number's name in front of its figures.
WIDTH, NAME = 61, 30


class MarginsDialog(ModalScreen[None]):
    """The margins that `state` has. `run` is what a shell calls the run."""

    BINDINGS: ClassVar = [
        Binding(
            "c",
            "copy",
            "copy",
            id="margins.copy",
            tooltip="copy all sentences, or the command that finds margins (OSC 52)",
        ),
        Binding("escape,m,q,enter", "dismiss", "close", id="margins.close", tooltip="close this dialog"),
    ]

    def __init__(self, state: RunState, run: str) -> None:
        super().__init__()
        self._margins, self._command = state.margins, f"ddenv margins {run}"

    def compose(self) -> ComposeResult:
        with Framed("Margins", "↑ ↓ scroll   c copies   escape closes", classes="dialog reading"), VerticalScroll():
            yield Static(self._said(), id="margins", markup=False)

    def _said(self) -> Text:
        margins = self._margins
        if margins is None or not (found := rows(margins)):
            return Text(f"How far may each number change before f goes? That is not known yet. Find it, and come back:\n\n"
                        f"    {plain(self._command)}   (c copies that)")  # fmt: skip
        text = Text(f"{BAR_WORDS}\n\n", "dim").append(f"  {bar_scale(WIDTH)}\n", "dim")
        for one in found:
            name, now, until, goal, runs = map(plain, one.cells)
            text.append(padded(shortened(name, NAME), NAME), "bold").append(f"  now {now}, {runs} runs\n", "not bold")
            text.append(f"  {bar(one.margin, WIDTH)}\n").append(f"  f until {until};  goal {goal}\n", "not bold")
        for words in filter(None, (nearest_fix(margins), sureness(margins))):
            text.append(f"\n{plain(words[:1].upper() + words[1:]).rstrip('.')}.\n")
        return text

    def action_copy(self) -> None:
        margins = self._margins
        lines = [one.sentence for one in rows(margins)] if margins is not None else []
        self.app.copy_to_clipboard("\n".join(map(plain, lines or [self._command])))
        self.query_one(Framed).say("copied, if the terminal allows it")
