"""The setup screen's form: the options of a run, with the place for complaints below them."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.containers import Grid, Horizontal, Vertical, VerticalScroll
from textual.message import Message
from textual.widgets import Button, Input, Label, Select, Static

from ddenv.errors import UserError
from ddenv.schemas import Kind
from ddenv.workbench import form
from ddenv.workbench.methods import chosen, uses
from ddenv.workbench.widgets.schema import SchemaSelect
from ddenv.workbench.wording import plain

if TYPE_CHECKING:
    from ddenv.world.scenario import Reduction, Scenario

MODES = ("automatic", "ask")
EARLY_STOP = "on: a test ends when the robot is stuck for good; full runs confirm what is left"
MARK = "✗ "
METHOD: dict[Kind, str] = {
    "algorithm": "how the environment is searched",
    "partitioning": "how the environment is split",
    "prioritization": "in which order the parts are tried",
}


class OptionsForm(Vertical):
    """Text fields by the ids of `ddenv.workbench.form`, the method, the accept mode, and Start."""

    class PlaceEdited(Message):
        """Spawn or goal were edited."""

    class Explain(Message):
        """A name is looked at; `here` is what the scenario has set for it, a sentence or ""."""

        def __init__(self, kind: Kind, name: str, here: str) -> None:
            super().__init__()
            self.kind, self.name, self.here = kind, name, here

    def __init__(self, *, id: str, classes: str) -> None:
        super().__init__(id=id, classes=classes)
        self._name_given = False
        self._here: dict[str, str] = {}
        self.border_title = "Options"

    def compose(self) -> ComposeResult:
        with VerticalScroll(id="fields", can_focus=False):
            for kind, tooltip in METHOD.items():
                with Horizontal(classes="row"):
                    yield Label(kind, markup=False)
                    yield SchemaSelect(kind, tooltip)
            with Grid(classes="grid"):
                for field in form.OPTIONS:
                    yield from _field(field)
                yield Label("early stop", markup=False)
                yield _select("early-stop", tuple(form.EARLY_STOP), EARLY_STOP)
            with Grid(id="places", classes="grid"):
                for field in form.PLACES:
                    yield from _field(field)
            with Horizontal(classes="row"):
                yield from _field(form.NAME)
        with Horizontal(classes="row", id="last"):
            yield Label("accept", markup=False)
            yield _select("accept", MODES, "take each reduction automatically, or ask before it")
            yield Static("", id="gap")
            yield Button("▶ Start", id="start", variant="primary", compact=True, tooltip="start the reduction (ctrl+s)")
        yield Static("", id="wrong", markup=False)

    def on_mount(self) -> None:
        self.query_one("#jobs", Input).value = _default_jobs()
        self.ask_for_places(False)

    @property
    def method(self) -> dict[str, Any]:
        """The chosen algorithm and pair, and whether tests may end early, by the scenario's keys."""
        names = {select.kind: select.chosen for select in self.query(SchemaSelect)}
        pair = f"{names['partitioning']}/{names['prioritization']}"
        early = form.EARLY_STOP[str(self.query_one("#early-stop", Select).value)]
        return {"algorithm": names["algorithm"], "pair": pair, "early_stop": early}

    @property
    def accept_mode(self) -> str:
        return str(self.query_one("#accept", Select).value)

    @property
    def texts(self) -> dict[str, str]:
        """What stands in the fields, by id."""
        return {field.id or "": field.value for field in self.query(Input)}

    def place(self, what: str) -> tuple[float, ...]:
        """The numbers of "spawn" (x, y, z m, yaw rad) or "goal" (x, y m). Raises FieldError."""
        fields = tuple(field for field in form.PLACES if field.id.startswith(what))
        numbers = tuple(form.values(fields, self.texts).values())
        if not all(math.isfinite(number) for number in numbers):
            raise form.FieldError(fields[0].id, f"{what}: expected finite numbers")
        return numbers

    def ask_for_places(self, ask: bool) -> None:
        """Spawn and goal are asked for where no scenario says them."""
        self.query_one("#places").display = ask

    def show_settings(self, scenario: Scenario) -> None:
        """Fills in what the scenario says, in place of what another one said or was mistyped."""
        texts = form.texts_of(scenario)
        if not form.are_jobs(self.texts["jobs"]):
            texts["jobs"] = _default_jobs()
        for id, text in texts.items():
            field = self.query_one(f"#{id}", Input)
            field.value = text
            field.remove_class("-wrong")
        early = scenario.failure.early_stop
        self.query_one("#early-stop", Select).value = next(word for word, on in form.EARLY_STOP.items() if on is early)
        self._show_method(scenario.reduction)

    def _show_method(self, reduction: Reduction) -> None:
        self._here = form.settings_of(reduction)
        names = chosen(reduction.algorithm, reduction.pair)
        for kind, name in names.items():
            select = self.query_one(f"#{kind}", SchemaSelect)
            with select.prevent(Select.Changed):
                select.value = name
        looked = next((each for each in self.query(SchemaSelect) if each.has_focus), None)
        kind = looked.kind if looked else "algorithm"
        self._dim(reduction.algorithm)
        self._look(kind, names[kind])

    @on(SchemaSelect.Looked)
    def _looked(self, event: SchemaSelect.Looked) -> None:
        event.stop()
        self._dim(event.name if event.kind == "algorithm" else self.method["algorithm"])
        self._look(event.kind, event.name)

    def _look(self, kind: Kind, name: str) -> None:
        self.post_message(self.Explain(kind, name, self._here.get(name, "")))

    def _dim(self, algorithm: str) -> None:
        """What the algorithm does not use stays a choice, for the next algorithm."""
        used = uses(algorithm)
        for select in self.query(SchemaSelect):
            select.set_class(select.kind != "algorithm" and select.kind not in used, "-unused")

    def suggest_name(self, name: str) -> None:
        """Fills in a run name, unless the user gave one."""
        if not self._name_given:
            field = self.query_one("#name", Input)
            with field.prevent(Input.Changed):
                field.value = name

    @on(Input.Changed)
    def _edited(self, event: Input.Changed) -> None:
        event.stop()
        event.input.remove_class("-wrong")
        if event.input.id == "name":
            self._name_given = bool(event.value.strip())
        elif event.input.id and event.input.id.startswith(("spawn", "goal")):
            self.post_message(self.PlaceEdited())

    def complain(self, error: UserError) -> None:
        """One line below the fields; the wrong field is marked and gets the cursor."""
        self.tell(f"{MARK}{error}")
        field = form.field_of(error)
        if field is not None:
            wrong = self.query_one(f"#{field}", Input)
            wrong.add_class("-wrong")
            wrong.focus()

    def tell(self, words: str) -> None:
        self.query_one("#wrong", Static).update(Text(plain(words)))


def _default_jobs() -> str:
    return str(os.cpu_count() or 1)


def _field(field: form.Field) -> ComposeResult:
    yield Label(field.label, markup=False)
    yield Input(id=field.id, compact=True, tooltip=field.tooltip)


def _select(id: str, choices: tuple[str, ...], tooltip: str) -> Select:
    select = Select([(choice, choice) for choice in choices], id=id, allow_blank=False, compact=True)
    select.tooltip = tooltip
    return select
