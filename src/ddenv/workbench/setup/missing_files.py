"""What of a world is not as its file says: what cannot be used, with the remedy of each, and parts
that were replaced or ignored.

The remedy of a file is a stand-in, `none`, or a folder, and is remembered by URI; one of Fuel can
be fetched. An element that is not supported can only be left out, `none`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar
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
from ddenv.runs.remedies import remedy, remembered, with_remedies
from ddenv.text import Data, count, plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.setup.files import complaints
from ddenv.workbench.shared.bindings import keys
from ddenv.workbench.widgets.path_entry import PathEntry
from ddenv.world.access import MissingFiles

if TYPE_CHECKING:
    from ddenv.world.model import Note, World
    from ddenv.world.scenario import Reading

OPEN = "?"
DONE = "✓"
MISSING = "missing file"
UNREADABLE = "unreadable file"
UNSUPPORTED = "unsupported element"
HOW = """auto       a guessed shape
none       without it
/a/folder  the folder that holds its model's folder; tab completes
box:x,y,z  or cylinder:radius,length, or sphere:radius (m)
It is used in every world that names this file."""


@dataclass(frozen=True, slots=True)
class Missing:
    """A URI that cannot be used, or the name of an element that is not supported: its `kind` says
    which.

    Its `remedy` is a stand-in as for `--stand-in`, the absolute path of a folder, or "" for none
    yet. `words` say what stands on the map for it, and first what is wrong with a file that was
    found, or if it is not in the folder that was chosen for it.
    """

    uri: str
    remedy: str
    words: str
    kind: str = MISSING


def kinds(rows: Iterable[Missing]) -> str:
    """How many of each kind there are, such as "2 missing files, 1 unsupported element"."""
    return ", ".join(
        count(number, kind) for kind, number in Counter(row.kind for row in rows).items()
    )


def read_with_remedies(
    path: Path, reading: Reading, options: Mapping[str, Any]
) -> tuple[World, Data, tuple[Missing, ...]]:
    """The world, with remembered remedies for what cannot be used, and a guess for all else; the
    `options` with these remedies.

    `reading` is the scenario's own, `options` are as on the command line. Raises Unsupported, and
    UserError.
    """
    from ddenv.runs.experiment import reading_of
    from ddenv.world.files.resources import fuel_model
    from ddenv.world.sdf.read import read_world
    from ddenv.world.sdf.standin import AUTO

    known = remembered()
    found = dict[str, str]()
    vain = dict[str, str]()
    wrong = dict[str, str]()
    while True:
        chosen = with_remedies(options, found)
        try:
            world = read_world(path, reading_of(reading, **chosen))
            break
        except MissingFiles as error:
            wrong |= error.uris
            # A folder does not help if the file is not in it.
            fresh = {uri: "" if uri in found else known.get(uri, "") for uri in error.uris}
            vain |= {uri: found[uri] for uri in error.uris if found.get(uri)}
            changed = {uri: text for uri, text in fresh.items() if found.get(uri, "") != text}
            found |= fresh
        if not changed:
            guessing = {**chosen, "stand_in": (*chosen.get("stand_in", ()), AUTO)}
            world = read_world(path, reading_of(reading, **guessing))
            break
    missing = []
    for uri, text in found.items():
        begin = f"'{uri}' by "
        by = next(
            (note.why.removeprefix(begin) for note in world.notes if note.why.startswith(begin)),
            "left out",
        )
        if text.startswith("/"):
            words = f"in {text}"
        else:
            words = by.removeprefix("a guess, ").removeprefix("the stand-in ")
        if not text:
            words = f"not in {vain[uri]}; guess {words}" if uri in vain else f"guess {words}"
        kind = MISSING
        if why := wrong[uri]:
            words = f"{why}; {words}"
            kind = UNREADABLE
        elif fuel_model(uri) and text in ("", AUTO):
            words = f"f fetches it; {words}"
        missing.append(Missing(uri, text, words, kind))
    return world, chosen, tuple(missing)


class MissingList(OptionList):
    """A row for each file or element that cannot be used, then for each kind of part that was
    replaced or ignored.

    It is hidden while there is none.
    """

    BINDINGS: ClassVar = keys(
        "missing",
        ("choose", "enter", "select", "remedy", "choose a folder or a shape, or leave it out"),
        (
            "guess",
            "a",
            "guess",
            "guess",
            "take the guessed shape for all undecided files, or else for this one",
        ),
        ("without", "w", "without", "without", "leave this one out"),
    )

    @dataclass
    class Chosen(Message):
        """The user chose remedies, by URI; "" takes one back."""

        remedies: dict[str, str]

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._rows: tuple[Missing, ...] = ()
        self.display = False

    def show(self, rows: tuple[Missing, ...], notes: tuple[Note, ...] = ()) -> None:
        """Shows other rows; the cursor stays where it was, or goes to the first row without a
        remedy.
        """
        same = [row.uri for row in rows] == [row.uri for row in self._rows]
        place = self.highlighted if same else None
        self._rows = rows
        of_files = tuple(
            note for note in notes if not any(f"'{row.uri}'" in note.why for row in rows)
        )
        self.set_options([Option(self._line(row), id=row.uri) for row in rows])
        for (what, kind, why), number in Counter(
            (note.what, note.kind, note.why) for note in of_files
        ).items():
            parts = f"{plain(what)} × {number}" if number > 1 else plain(what)
            text = (
                Text(no_wrap=True, overflow="ellipsis")
                .append(f"  {kind} {parts}  ")
                .append(plain(why), "dim")
            )
            self.add_option(Option(text))
        undecided = [index for index, row in enumerate(rows) if not row.remedy]
        first = next(iter(undecided), 0) if place is None else place
        self.highlighted = first if self.option_count else None
        self.display = self.option_count > 0
        self.set_class(not undecided, "-folded")
        said = [f"remedies for {kinds(rows)}"] if rows else []
        said += [f"{count(len(of_files), 'part')} replaced or ignored"] if of_files else []
        self.border_title = f"{', '.join(said)} (m)"
        if undecided:
            self.border_title = f"{kinds(rows)} (m), {len(undecided)} without a remedy"

    def _line(self, row: Missing) -> Text:
        color = self.app.theme_variables["text-success" if row.remedy else "text-warning"]
        text = Text(no_wrap=True, overflow="ellipsis").append(
            DONE if row.remedy else OPEN, f"bold {color}"
        )
        # The last word of a URI tells models and meshes apart.
        name = plain(unquote(row.uri).rstrip("/").rsplit("/", 1)[-1]) or plain(row.uri)
        return text.append(f" {name}  ").append(plain(row.words), "dim")

    @on(OptionList.OptionSelected)
    def _selected(self, event: OptionList.OptionSelected) -> None:
        event.stop()
        if event.option_index >= len(self._rows):
            return
        row = self._rows[event.option_index]
        if row.kind == UNSUPPORTED:
            self.action_without()
            return

        def take(text: str | None) -> None:
            if text is not None:
                self.post_message(self.Chosen({row.uri: text}))

        self.app.push_screen(AskRemedy(row), take)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        return bool(self._rows) or action not in ("guess", "without")

    def action_guess(self) -> None:
        undecided = [row.uri for row in self._rows if not row.remedy]
        self.post_message(self.Chosen(dict.fromkeys(undecided or self._here, "auto")))

    def action_without(self) -> None:
        self.post_message(self.Chosen(dict.fromkeys(self._here, "none")))

    @property
    def _here(self) -> list[str]:
        place = self.highlighted
        if place is None:
            return []
        return [row.uri for row in self._rows[place : place + 1]]


class AskRemedy(ModalScreen[str | None]):
    """Asks for the remedy of one missing file."""

    BINDINGS: ClassVar = [
        Binding("escape", "dismiss(None)", "cancel", id="remedy.cancel", tooltip="change nothing")
    ]

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
        with complaints(self):
            if not event.value.strip() and not self._row.remedy:
                raise UserError("type one of these, or press escape to change nothing")
            self.dismiss(remedy(event.value))
