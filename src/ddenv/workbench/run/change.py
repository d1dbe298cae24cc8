"""Changing how a run goes on: the pair, the algorithm, when a candidate is taken, re-runs and the
budget.
"""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.containers import Horizontal, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Button, Input, Select, Static

from ddenv.errors import UserError
from ddenv.guiding import commands
from ddenv.guiding.commands import Context
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.schemas import names
from ddenv.settings import Value
from ddenv.text import plain
from ddenv.words.methods import KINDS, chosen, note, paragraph
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.bindings import keys
from ddenv.workbench.widgets.entry import Entry

# Beside the pair and the algorithm, which have lists.
OTHERS = tuple(one for one in commands.CHANGEABLE.values() if one.shown != "method")


class Change(ModalScreen[commands.Change | None]):
    """Returns the command that changes the settings, None if it was cancelled."""

    CSS_PATH = "run_dialogs.tcss"
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (34, "-tall")]
    BINDINGS: ClassVar = [
        *keys("change", ("cancel", "escape", "dismiss(None)", "cancel", "change nothing")),
        *keys(
            "change", ("apply", "ctrl+s", "apply", "change", "change the settings"), priority=True
        ),
    ]

    def __init__(self, state: RunState) -> None:
        super().__init__()
        self._state = state

    def compose(self) -> ComposeResult:
        options = settings(self._state)
        used = chosen(options.algorithm, options.pair)
        with Framed("Change settings, from the next round on", "ctrl+s changes   escape cancels"):
            with VerticalScroll(can_focus=False, classes="fields"):
                for kind in KINDS:
                    with Horizontal(classes="row"):
                        yield Static(kind, classes="label", markup=False)
                        now = used[kind]
                        # A schema of another package may not be installed here: it can stay.
                        known = (*names(kind), *(() if now in names(kind) else (now,)))
                        yield _select(kind, [(Text(plain(name)), name) for name in known], now)
                    yield Static("", id=f"{kind}-meaning", classes="meaning", markup=False)
                for one in OTHERS:
                    with Horizontal(classes="row"):
                        yield Static(one.label, classes="label", markup=False)
                        now = "" if (value := getattr(options, one.name)) is None else str(value)
                        choices = [(Text(name), name) for name in one.choices]
                        yield (
                            _select(one.name, choices, now)
                            if one.choices
                            else Entry(now, id=one.name)
                        )
                    empty = "; empty: no limit" if one.none else ""
                    yield Static(f"{one.summary}{empty}", classes="meaning", markup=False)
            yield Static("", id="wrong", classes="wrong", markup=False)
            with Horizontal(classes="buttons"):
                yield Button("Change", id="apply", variant="primary")
                yield Button("Cancel", id="cancel")

    @on(Select.Changed)
    def _explain(self) -> None:
        algorithm = str(self.query_one("#algorithm", Select).value)
        for kind in KINDS:
            name = str(self.query_one(f"#{kind}", Select).value)
            words = note(kind, algorithm) or paragraph(kind, name)
            self.query_one(f"#{kind}-meaning", Static).update(Text(words))

    def _command(self) -> commands.Change:
        """The command for the settings in the dialog. Raises UserError, which begins with the name
        of the first wrong field.
        """
        kinds = {kind: str(self.query_one(f"#{kind}", Select).value) for kind in KINDS}
        asked: dict[str, Value] = {
            "pair": f"{kinds['partitioning']}/{kinds['prioritization']}",
            "algorithm": kinds["algorithm"],
        }
        wrong = []
        for one in OTHERS:
            id = f"#{one.name}"
            field = self.query_one(id, Select) if one.choices else self.query_one(id, Input)
            try:
                asked[one.name] = commands.typed(one.name, str(field.value))
            except UserError as error:
                wrong.append(str(error))
        if wrong:
            raise UserError("; ".join(wrong))
        command = commands.Change(commands.Change(asked).new(self._state))
        if why := command.refusal(Context(self._state)):
            raise UserError(why)
        return command

    @on(Input.Submitted)
    def action_apply(self) -> None:
        try:
            command = self._command()
        except UserError as error:
            self.query_one("#wrong", Static).update(Text(str(error)))
            field = str(error).partition(":")[0]
            if any(field == one.name for one in OTHERS):
                self.query_one(f"#{field}", Input).focus()
            return
        self.dismiss(command)

    def on_button_pressed(self, event: Button.Pressed) -> None:
        if event.button.id == "apply":
            self.action_apply()
        else:
            self.dismiss(None)


def _select(name: str, options: list[tuple[Text, str]], now: str) -> Select[str]:
    return Select(options, value=now, allow_blank=False, id=name, compact=True)
