"""Changing how a run goes on: the pair, the algorithm, re-runs and the budget."""

from __future__ import annotations

from typing import Any, ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Button, Input, Select, Static

from ddenv.errors import UserError
from ddenv.runfile.settings import settings
from ddenv.runfile.state import RunState
from ddenv.schemas import Kind, names
from ddenv.settings import SETTINGS, Setting
from ddenv.workbench.run.methods import KINDS, note, paragraph
from ddenv.workbench.wording import count, plain

# Beside the pair and the algorithm, which have lists.
NUMBERS = tuple(one for one in SETTINGS.values() if one.may_change and one.shown != "method")


class Change(ModalScreen[dict[str, Any] | None]):
    """The settings as they stand here, None if that was left. They hold from the next round on."""

    CSS_PATH = "run_dialogs.tcss"
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (34, "-tall")]
    BINDINGS: ClassVar = [
        Binding("escape", "cancel", "cancel", id="change.cancel", tooltip="change nothing"),
        Binding("ctrl+s", "apply", "change", id="change.apply", tooltip="change the settings", priority=True),
    ]

    def __init__(self, state: RunState) -> None:
        super().__init__()
        options = settings(state)
        partitioning, _, prioritization = options.pair.partition("/")
        self._now: dict[Kind, str] = {
            "algorithm": options.algorithm,
            "partitioning": partitioning,
            "prioritization": prioritization,
        }
        now = {one.name: getattr(options, one.name) for one in NUMBERS}
        self._texts = {name: "" if value is None else str(value) for name, value in now.items()}
        self._done = state.tests_done

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = "Change settings, from the next round on"
            dialog.border_subtitle = "ctrl+s changes   escape cancels"
            with VerticalScroll(can_focus=False, classes="fields"):
                for kind in KINDS:
                    with Horizontal(classes="row"):
                        yield Static(kind, classes="label", markup=False)
                        yield self._select(kind)
                    yield Static("", id=f"{kind}-meaning", classes="meaning", markup=False)
                for one in NUMBERS:
                    with Horizontal(classes="row"):
                        yield Static(one.label, classes="label", markup=False)
                        yield Input(self._texts[one.name], id=one.name, compact=True)
                    empty = "; empty for no limit" if one.none else ""
                    yield Static(f"{one.summary}{empty}", classes="meaning", markup=False)
            yield Static("", id="wrong", classes="wrong", markup=False)
            with Horizontal(classes="buttons"):
                yield Button("Change", id="apply", variant="primary")
                yield Button("Cancel", id="cancel")

    def _select(self, kind: Kind) -> Select[str]:
        now = self._now[kind]
        # What another package brought may not be installed here: it can stay as it is.
        known = (*names(kind), *(() if now in names(kind) else (now,)))
        return Select(
            [(Text(plain(name)), name) for name in known], value=now, allow_blank=False, id=kind, compact=True
        )

    @on(Select.Changed)
    def _explain(self) -> None:
        algorithm = str(self.query_one("#algorithm", Select).value)
        for kind in KINDS:
            name = str(self.query_one(f"#{kind}", Select).value)
            words = note(kind, algorithm) or paragraph(kind, name)
            self.query_one(f"#{kind}-meaning", Static).update(Text(words))

    def asked(self) -> dict[str, Any]:
        """All settings as they stand in the dialog. Raises UserError."""
        kinds = {kind: str(self.query_one(f"#{kind}", Select).value) for kind in KINDS}
        return {
            "pair": f"{kinds['partitioning']}/{kinds['prioritization']}",
            "algorithm": kinds["algorithm"],
            **{one.name: self._number(one) for one in NUMBERS},
        }

    def _number(self, one: Setting) -> int | None:
        text = self.query_one(f"#{one.name}", Input).value.strip()
        if not text and one.none:
            return None
        try:
            number = int(text)
        except ValueError:
            raise UserError(f"{one.name}: expected a whole number, found '{text[:20]}'") from None
        if not one.allows(number):
            raise UserError(f"{one.name}: expected {one.range}, found {number}")
        if one.name == "budget" and number <= self._done:
            raise UserError(f"budget: {count(self._done, 'test')} are made already; give more, or leave it empty")
        return number

    @on(Input.Submitted)
    def action_apply(self) -> None:
        try:
            asked = self.asked()
        except UserError as error:
            self.query_one("#wrong", Static).update(Text(str(error)))
            # The message begins with the field that is wrong.
            self.query_one(f"#{str(error).partition(':')[0]}", Input).focus()
            return
        self.dismiss(asked)

    def on_button_pressed(self, event: Button.Pressed) -> None:
        if event.button.id == "apply":
            self.action_apply()
        else:
            self.dismiss(None)

    def action_cancel(self) -> None:
        self.dismiss(None)
