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
from ddenv.text import count, plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.setup.remedies import Missing, remedy
from ddenv.workbench.widgets.path_entry import PathEntry

OPEN, DONE = "?", "✓"
HOW = """auto       a guessed shape
none       without it
/a/folder  the folder that holds its model's folder; tab completes
box:x,y,z  or cylinder:radius,length, or sphere:radius (m)
It is used in every world that names this file."""


class MissingList(OptionList):
    """A row for each missing file; hidden while there is none."""

    BINDINGS: ClassVar = [
        Binding(
            "enter", "select", "remedy", id="missing.choose", tooltip="choose a folder or a shape, or leave it out"
        ),
        Binding(
            "a",
            "guess",
            "guess",
            id="missing.guess",
            tooltip="take the guessed shape wherever nothing is chosen, or else for this one",
        ),
        Binding("w", "without", "without", id="missing.without", tooltip="leave this one out"),
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
        self.clear_options()
        self.add_options(Option(self._line(row), id=row.uri) for row in rows)
        undecided = next((index for index, row in enumerate(rows) if not row.remedy), 0)
        self.highlighted = (undecided if place is None else place) if rows else None
        self.display = bool(rows)
        still = sum(not row.remedy for row in rows)
        self.border_title = f"{count(len(rows), 'file')} missing (m)" + (f", {still} without a remedy" if still else "")

    def _line(self, row: Missing) -> Text:
        color = self.app.theme_variables["text-success" if row.remedy else "text-warning"]
        text = Text(no_wrap=True, overflow="ellipsis").append(DONE if row.remedy else OPEN, f"bold {color}")
        return text.append(f" {_short(row.uri)}  ").append(plain(row.words), "dim")

    @on(OptionList.OptionSelected)
    def _selected(self, event: OptionList.OptionSelected) -> None:
        event.stop()
        row = self._rows[event.option_index]
        self.app.push_screen(AskRemedy(row), lambda text: self._take(row.uri, text))

    def _take(self, uri: str, text: str | None) -> None:
        if text is not None:
            self.post_message(self.Chosen({uri: text}))

    def action_guess(self) -> None:
        undecided = [row.uri for row in self._rows if not row.remedy]
        if not undecided and self.highlighted is not None:
            undecided = [self._rows[self.highlighted].uri]
        self.post_message(self.Chosen(dict.fromkeys(undecided, "auto")))

    def action_without(self) -> None:
        if self.highlighted is not None:
            self.post_message(self.Chosen({self._rows[self.highlighted].uri: "none"}))


class AskRemedy(ModalScreen[str | None]):
    """Asks for the remedy of one missing file."""

    BINDINGS: ClassVar = [Binding("escape", "cancel", "cancel", id="remedy.cancel", tooltip="change nothing")]

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
            text = remedy(event.value)
        except UserError as error:
            self.query_one("#wrong", Static).update(Text(str(error).removeprefix("remedy: ")))
            return
        self.dismiss(text)

    def action_cancel(self) -> None:
        self.dismiss(None)


def _short(uri: str) -> str:
    """The last word of a URI, which tells models and meshes apart."""
    return plain(unquote(uri).rstrip("/").rsplit("/", 1)[-1]) or plain(uri)
