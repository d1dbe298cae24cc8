"""Lists to choose from: models by their names, and the layers of the map."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from ddenv.text import Names, count, shortened
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.map.place import LAYERS
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.bindings import keys

# Maximum number of names listed at once, and the maximum width of each in cells; typing finds
# others.
LISTED = 100
WIDTH = 36


class ChooseModels(ModalScreen[Names | None]):
    """Returns the chosen names, None if it was cancelled. Beside the list the map marks the model
    under the cursor.
    """

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = keys(
        "choose",
        ("cancel", "escape", "close", "cancel", "choose nothing"),
        ("down", "down", "move(1)", "", "next name"),
        ("up", "up", "move(-1)", "", "previous name"),
        ("toggle", "tab", "mark", "", "choose this model, or take it out again"),
    )

    def __init__(
        self,
        title: str,
        names: Sequence[str],
        *,
        several: bool,
        mark: Callable[[str | None], None],
        pinned: Iterable[str] = (),
        chosen: Iterable[str] = (),
    ) -> None:
        """`title` says what they are for; `pinned` ones are marked with +; `chosen` ones come
        first.

        `mark` shows a model on the map, and none in the end.
        """
        super().__init__()
        self._title = title
        self._several = several
        self._mark = mark
        self._pinned = frozenset(pinned)
        self._chosen = set(chosen)
        self._names = tuple(sorted(names, key=lambda name: name not in self._chosen))
        # The names with the typed part: the first ones are listed.
        self._found: list[str] = []
        self._part: str | None = None

    def compose(self) -> ComposeResult:
        if self._several:
            keys = "space tick   enter take   escape cancel"
        else:
            keys = "enter take it   escape cancel"
        with Framed("Models" if self._several else "Model", keys):
            yield Static(self._title, id="purpose", markup=False)
            yield Input(placeholder="part of a name", id="filter", compact=True)
            yield OptionList(id="names", compact=True, markup=False)
            yield Static("", id="found", markup=False)

    def on_mount(self) -> None:
        self.query_one(Input).focus()
        self._filter()

    @on(Input.Changed)
    def _typed(self) -> None:
        """A space ticks the model under the cursor. It comes through the field, so that no key
        overtakes another.
        """
        field = self.query_one(Input)
        if self._several and " " in field.value:
            field.value = field.value.replace(" ", "")
            self.action_mark()
        else:
            self._filter()

    def _filter(self) -> None:
        """Lists the names with the typed part. Each key calls it first: fast typing is ahead of the
        message `Changed`.
        """
        part = self.query_one(Input).value.strip().lstrip("/").casefold()
        if part == self._part:
            return
        self._part = part
        self._found = [name for name in self._names if part in name.casefold()]
        options = self.query_one(OptionList)
        options.set_options(Option(self._prompt(name)) for name in self._found[:LISTED])
        options.highlighted = 0 if self._found else None
        self._show_found()

    def _show_found(self) -> None:
        words = [f"{count(len(self._chosen), 'model')} chosen"] if self._several else []
        if not self._found:
            words.append("no name contains this")
        elif len(self._found) > LISTED:
            words.append(f"{len(self._found) - LISTED} more: type to see them")
        self.query_one("#found", Static).update(Text("   ".join(words)))

    def _prompt(self, name: str) -> Text:
        mark = ""
        if self._several:
            mark = "[x] " if name in self._chosen else "[ ] "
        pin = "+ " if name in self._pinned else ""
        return Text(f"{mark}{pin}{shortened(name, WIDTH)}", no_wrap=True)

    def action_move(self, by: int) -> None:
        self._filter()
        options = self.query_one(OptionList)
        (options.action_cursor_down if by > 0 else options.action_cursor_up)()

    def action_mark(self) -> None:
        self._filter()
        place = self.query_one(OptionList).highlighted
        if self._several and place is not None:
            self._chosen ^= {self._found[place]}
            self.query_one(OptionList).replace_option_prompt_at_index(
                place, self._prompt(self._found[place])
            )
            self._show_found()

    @on(OptionList.OptionHighlighted)
    def _show_on_map(self, event: OptionList.OptionHighlighted) -> None:
        self._mark(self._found[event.option_index])

    @on(Input.Submitted)
    def _take(self) -> None:
        self._filter()
        place = self.query_one(OptionList).highlighted
        if self._chosen:
            self.action_close(tuple(name for name in self._names if name in self._chosen))
        elif place is not None:
            self.action_close((self._found[place],))

    @on(OptionList.OptionSelected)
    def _clicked(self, event: OptionList.OptionSelected) -> None:
        if self._several:
            self.action_mark()
            self.query_one(Input).focus()
        else:
            self.action_close((self._found[event.option_index],))

    def action_close(self, chosen: Names | None = None) -> None:
        self._mark(None)
        self.dismiss(chosen)


class Layers(ModalScreen[None]):
    """A list of the map's layers; those that are shown are marked."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = keys(
        "layers",
        ("toggle", "space", "switch", "show or hide", "show this layer or hide it"),
        ("close", "escape,l,q", "dismiss", "close", "back to the map"),
    )

    def __init__(self, world: WorldMap) -> None:
        super().__init__()
        self._world = world

    def compose(self) -> ComposeResult:
        with Framed("What the map shows", "space or click shows or hides   escape closes"):
            yield OptionList(
                *(Option(self._prompt(name)) for name in LAYERS), compact=True, markup=False
            )

    def _prompt(self, name: str) -> Text:
        mark = "[x]" if name in self._world.shown.layers else "[ ]"
        return Text(f"{mark} {name:<12} ", no_wrap=True).append(LAYERS[name], "dim")

    @on(OptionList.OptionSelected)
    def action_switch(self) -> None:
        options = self.query_one(OptionList)
        if (place := options.highlighted) is not None:
            name = list(LAYERS)[place]
            self._world.toggle_layer(name)
            options.replace_option_prompt_at_index(place, self._prompt(name))
