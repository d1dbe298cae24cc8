"""The setup screen's form: every setting of a run with its meaning, the cost, and the command."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.text import Text
from textual import events, on
from textual.app import ComposeResult
from textual.containers import Grid, Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.message import Message
from textual.widget import Widget
from textual.widgets import Button, Input, Label, Select, Static

from ddenv.errors import UserError
from ddenv.runs import processor
from ddenv.schemas import OURS, names, uses
from ddenv.settings import JOBS, Setting
from ddenv.text import as_sentence, plain
from ddenv.words.methods import KINDS, chosen, note, paragraph
from ddenv.workbench.setup import form
from ddenv.workbench.setup.form import FIELDS
from ddenv.workbench.widgets.entry import Entry

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

MARK = "✗ "
MORE = f"▸ more settings (f9): {', '.join(one.label for one in form.ADVANCED)}"


def not_used(one: Setting, algorithm: str) -> str:
    unused = one.used_by and algorithm in OURS["algorithm"] and algorithm not in one.used_by
    if unused:
        return f"Not used by {plain(algorithm)}."
    return ""


class OptionsForm(Vertical):
    """The fields of `ddenv.workbench.setup.form`, whose ids are their names, the method, the cost,
    the command, and Start.
    """

    @dataclass
    class Edited(Message):
        """A setting changed; `place` says that spawn or goal did."""

        place: bool = False

        def can_replace(self, message: Message) -> bool:
            return isinstance(message, OptionsForm.Edited) and self.place >= message.place

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self._name_given = False
        self._suggested = ""
        # What is wrong with fields, by id, and what else is wrong.
        self._problems: dict[str, str] = {}
        self._message = ""
        # The texts of the rarely used fields, while they are not opened: with these the screen
        # would open 0.15 s later.
        self._unopened = {one.name: next(iter(form.choices(one)), "") for one in form.ADVANCED}
        self.border_title = "Settings"

    def compose(self) -> ComposeResult:
        with VerticalScroll(id="fields", can_focus=False):
            with Grid(id="method"):
                for kind in KINDS:
                    yield Label(kind, markup=False)
                    yield Select(
                        [(name, name) for name in names(kind)],
                        id=kind,
                        allow_blank=False,
                        compact=True,
                    )
            yield Grid(*_widgets(form.BASIC), id="basic", classes="grid")
            yield Grid(*_widgets(form.PLACES), id="places", classes="grid")
            yield Button(
                Content(MORE), id="more", compact=True, tooltip="the rarely used settings (f9)"
            )
        yield Static("", id="wrong", markup=False)
        yield VerticalScroll(Static("", markup=False), id="explained")
        with Horizontal(id="last"):
            yield from _widgets((form.NAME, form.ACCEPT))
            yield Button(
                "▶ Start",
                id="start",
                variant="primary",
                compact=True,
                tooltip="start the reduction (ctrl+s)",
            )
        yield Static("", id="cost", markup=False)
        yield Static("", id="command", markup=False)

    def on_mount(self) -> None:
        self.watch(self.screen, "focused", self._mark)
        self.query_one("#jobs", Input).value = str(processor.usable_cores())
        self.show_message("")

    def _mark(self, focused: Widget | None) -> None:
        within = focused is not None and self in focused.ancestors
        if within != self.has_class("-within"):
            # Its fields look the same with it.
            self.set_class(within, "-within", update=False)
            self.app.stylesheet.update_nodes([self])

    @property
    def method(self) -> tuple[str, str]:
        algorithm, partitioning, prioritization = (
            str(self.query_one(f"#{kind}", Select).value) for kind in KINDS
        )
        return f"{partitioning}/{prioritization}", algorithm

    @property
    def jobs(self) -> int:
        """Raises FieldError."""
        return int(form.value(JOBS, self.texts["jobs"]) or 0)

    @property
    def texts(self) -> dict[str, str]:
        return self._unopened | {id: str(field.value) for id, field in self._fields()}

    def _fields(self) -> Iterator[tuple[str, Input | Select[str]]]:
        for field in self.query("Input, Select"):
            if isinstance(field, Input | Select) and field.id in FIELDS:
                yield field.id, field

    @property
    def own_name(self) -> str:
        name = self.texts["run_name"].strip()
        if self._name_given and name != self._suggested:
            return name
        return ""

    def show_settings(self, scenario: Scenario, places: Mapping[str, str]) -> None:
        """Fills in the scenario's settings, in place of all earlier texts, with the texts of
        `places` in place of its own.
        """
        texts = form.texts_of(scenario) | dict(places)
        if form.problem(JOBS, self.texts["jobs"]):
            texts["jobs"] = str(processor.usable_cores())
        self.set_texts(texts)
        names = chosen(scenario.reduction.algorithm, scenario.reduction.pair)
        for kind, name in names.items():
            select = self.query_one(f"#{kind}", Select)
            with select.prevent(Select.Changed):
                select.value = name
        self._dim()
        self._explain(self.app.focused)
        self.post_message(self.Edited(place=True))

    def set_texts(self, texts: dict[str, str]) -> None:
        self._unopened |= {id: text for id, text in texts.items() if id in self._unopened}
        for id, field in self._fields():
            if id in texts:
                self._problems.pop(id, None)
                if str(field.value) != texts[id]:
                    field.value = texts[id]
        self._show_problems()

    def show_fields(self, show: bool) -> None:
        self.query_one("#fields").display = self.query_one("#explained").display = show

    def suggest_name(self, name: str) -> None:
        self._suggested = name
        if not self._name_given:
            field = self.query_one("#run_name", Input)
            with field.prevent(Input.Changed):
                field.value = name

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        self._explain(event.widget)

    def _explain(self, widget: Widget | None) -> None:
        """In a few lines that scroll, the field that has the focus, or else the algorithm, which
        most depends on.
        """
        # An open list of names is a widget inside its field.
        if widget is None:
            near = []
        else:
            near = [each.id for each in (widget, widget.parent) if each is not None]
        id = next((each for each in near if each in FIELDS or each in KINDS), "") or ""
        pair, algorithm = self.method
        panel = self.query_one("#explained")
        if widget is panel:
            return
        kind = next((kind for kind in KINDS if kind == id), KINDS[0])
        name = chosen(algorithm, pair)[kind]
        title = f"{kind} {plain(name)}"
        words = paragraph(kind, name)
        warning = note(kind, algorithm)
        if id in FIELDS:
            one = FIELDS[id]
            words = " ".join(filter(None, (as_sentence(one.summary), one.more, one.cost)))
            title = one.label
            warning = not_used(one, algorithm)
        text = Text(title, "bold").append("  ")
        if warning:
            text.append(warning, f"bold {self.app.theme_variables['text-warning']}").append(" ")
        panel.query_one(Static).update(text.append(words, "not bold"))
        panel.scroll_home(animate=False)

    def _dim(self) -> None:
        """Parts that the algorithm does not use can still be chosen, for the next algorithm."""
        algorithm = self.method[1]
        for kind in KINDS:
            unused = kind != "algorithm" and kind not in uses(algorithm)
            self.query_one(f"#{kind}").set_class(unused, "-unused")
        for id, field in self._fields():
            field.set_class(bool(not_used(FIELDS[id], algorithm)), "-unused")

    def show_outcome(self, cost: str, words: str, typed: bool) -> None:
        """What the run will cost, and the command that does the same, or why there is none."""
        self.query_one("#cost", Static).update(Text(cost))
        command = self.query_one("#command", Static)
        command.update(
            Text("$ " if typed and words else "", "bold").append(plain(words), "not bold")
        )
        command.tooltip = plain(words) or None

    def complain(self, error: UserError) -> None:
        """Shows an error below the fields, until it is corrected; wrong fields are marked, and the
        first one gets the cursor.
        """
        if not isinstance(error, form.FieldError):
            self.show_message(f"{MARK}{error}")
            return
        if any(FIELDS[id] in form.ADVANCED for id in error.wrong):
            self._show_more(True)
        self._message = ""
        self._problems = error.wrong | self._problems | error.wrong

        def point() -> None:
            self._show_problems()
            self.query_one(f"#{next(iter(error.wrong))}").focus()

        self.call_after_refresh(point)

    def show_message(self, words: str) -> None:
        self._message = words
        self._problems.clear()
        self._show_problems()

    def _show_problems(self) -> None:
        line = self.query_one("#wrong", Static)
        words = f"{MARK}{form.in_words(self._problems)}" if self._problems else self._message
        line.display = bool(words)
        line.update(Text(plain(words)))
        for id, field in self._fields():
            field.set_class(id in self._problems, "-wrong")

    def on_descendant_blur(self, event: events.DescendantBlur) -> None:
        """A field is checked when it is left; an empty one only at the start of a run."""
        one = FIELDS.get(event.widget.id or "")
        if (
            one is not None
            and (text := self.texts[one.name]).strip()
            and (wrong := form.problem(one, text))
        ):
            self._problems[one.name] = wrong
            self._show_problems()

    @on(Button.Pressed, "#more")
    def toggle_more(self) -> None:
        self._show_more(not any(grid.display for grid in self.query("#advanced")))

    def _show_more(self, show: bool) -> None:
        if not self.query("#advanced"):
            fields = _widgets(form.ADVANCED, self._unopened)
            self.query_one("#fields").mount(Grid(*fields, id="advanced", classes="grid"))
            self.call_after_refresh(self._dim)
        self.query_one("#advanced").display = show
        self.query_one("#more", Button).label = Content("▾ fewer settings (f9)" if show else MORE)

    @on(Input.Changed)
    def _typed(self, event: Input.Changed) -> None:
        event.stop()
        if event.input.id == "run_name":
            self._name_given = bool(event.value.strip())
        self._edited(event.input)

    @on(Select.Changed)
    def _picked(self, event: Select.Changed) -> None:
        event.stop()
        self._dim()
        if event.select.id in KINDS:
            self._explain(event.select)
        self._edited(event.select)

    def _edited(self, widget: Widget) -> None:
        id = widget.id or ""
        if id in FIELDS and (id in self._problems or self._message):
            # An error goes away as soon as its field is right.
            self._message = ""
            if wrong := form.problem(FIELDS[id], self.texts[id]):
                self._problems[id] = wrong
            else:
                self._problems.pop(id, None)
            self._show_problems()
        self.post_message(self.Edited(FIELDS.get(id) in form.PLACES))


def _widgets(fields: tuple[Setting, ...], texts: Mapping[str, str] = {}) -> Iterator[Widget]:
    for one in fields:
        yield Label(one.label, markup=False)
        if names := form.choices(one):
            value = texts.get(one.name, names[0])
            choices = [(name, name) for name in names]
            yield Select(choices, value=value, id=one.name, allow_blank=False, compact=True)
        else:
            yield Entry(texts.get(one.name, ""), id=one.name, placeholder=one.none)
