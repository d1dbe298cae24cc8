"""The rows of files that cannot be found, each with its remedy, and the dialog that asks for one."""

from __future__ import annotations

from typing import ClassVar
from urllib.parse import unquote

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.message import Message
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from ddenv.errors import UserError
from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.setup.remedies import Missing, remedy
from ddenv.workbench.shared.wording import count
from ddenv.workbench.widgets.path_entry import PathEntry

OPEN, DONE = "?", "✓"
HOW = """auto       a guessed shape
none       without it
/a/folder  the folder that holds its model's folder; tab completes
box:x,y,z  or cylinder:radius,length, or sphere:radius (m)
It is used in every world that names this file."""


def _key(key: str, action: str, words: str, tooltip: str) -> Binding:
    return Binding(key, action, words, id=f"missing.{'choose' if key == 'enter' else words}", tooltip=tooltip)


class MissingList(OptionList):
    """A row for each missing file; hidden while there is none."""

    BINDINGS: ClassVar = [
        _key("enter", "select", "remedy", "choose a folder or a shape, or leave it out"),
        _key("a", "guess", "guess", "take the guessed shape wherever nothing is chosen, or else for this one"),
        _key("w", "without", "without", "leave this one out"),
    ]

    class Chosen(Message):
        """The user chose remedies, by URI; "" takes one back."""

        def __init__(self, remedies: dict[str, str]) -> None:
            super().__init__()
            self.remedies = remedies

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._rows: tuple[Missing, ...] = ()
        self.display = False

    def show(self, rows: tuple[Missing, ...]) -> None:
        """Shows other rows; the cursor stays where it was, or goes to the first row without a remedy."""
        same = [row.uri for row in rows] == [row.uri for row in self._rows]
        place, self._rows = self.highlighted if same else None, rows
        self.set_options(Option(self._line(row), id=row.uri) for row in rows)
        undecided = [index for index, row in enumerate(rows) if not row.remedy]
        self.highlighted = (next(iter(undecided), 0) if place is None else place) if rows else None
        self.display = bool(rows)
        still = f", {len(undecided)} without a remedy" if undecided else ""
        self.border_title = f"{count(len(rows), 'file')} missing (m){still}"

    def _line(self, row: Missing) -> Text:
        color = self.app.theme_variables["text-success" if row.remedy else "text-warning"]
        text = Text(no_wrap=True, overflow="ellipsis").append(DONE if row.remedy else OPEN, f"bold {color}")
        # The last word of a URI tells models and meshes apart.
        name = plain(unquote(row.uri).rstrip("/").rsplit("/", 1)[-1]) or plain(row.uri)
        return text.append(f" {name}  ").append(plain(row.words), "dim")

    @on(OptionList.OptionSelected)
    def _selected(self, event: OptionList.OptionSelected) -> None:
        event.stop()
        row = self._rows[event.option_index]

        def take(text: str | None) -> None:
            if text is not None:
                self.post_message(self.Chosen({row.uri: text}))

        self.app.push_screen(AskRemedy(row), take)

    def action_guess(self) -> None:
        here = [] if self.highlighted is None else [self._rows[self.highlighted].uri]
        self.post_message(self.Chosen(dict.fromkeys([row.uri for row in self._rows if not row.remedy] or here, "auto")))

    def action_without(self) -> None:
        if self.highlighted is not None:
            self.post_message(self.Chosen({self._rows[self.highlighted].uri: "none"}))


class AskRemedy(ModalScreen[str | None]):
    """Asks for the remedy of one missing file."""

    BINDINGS: ClassVar = [Binding("escape", "dismiss(None)", "cancel", id="remedy.cancel", tooltip="change nothing")]

    def __init__(self, row: Missing) -> None:
        super().__init__()
        self._row = row

    def compose(self) -> ComposeResult:
        with Framed("A remedy for a missing file", "enter takes it   escape cancels"):
            yield Static(Text(plain(self._row.uri)), markup=False)
            yield Static(Text(f"now: {plain(self._row.words)}", "dim"), markup=False)
            yield PathEntry(self._row.remedy or "auto", id="remedy")
            yield Static("", id="wrong", classes="wrong", markup=False)
            yield Static(Text(HOW, "dim"), markup=False)

    @on(Input.Submitted)
    def _typed(self, event: Input.Submitted) -> None:
        try:
            if not event.value.strip() and not self._row.remedy:
                raise UserError("type one of these, or press escape to change nothing")
            self.dismiss(remedy(event.value))
        except UserError as error:
            self.query_one("#wrong", Static).update(Text(str(error).removeprefix("remedy: ")))
