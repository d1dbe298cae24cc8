"""What the map shows: each layer can be switched off."""

from __future__ import annotations

from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from ddenv.workbench.map.world_map import WorldMap

MEANINGS = {
    "partitions": "the parts of this round, by letter and colour",
    "removed": "where removed models stood",
    "pinned": "which models are pinned",
    "sensed": "in which order the robot sensed the models",
    "path": "the robot's path on the last similar run",
    "original": "the robot's path in f itself",
    "failure": "where the robot ended in f",
}


class Layers(ModalScreen[None]):
    """A list of the map's layers with a mark at those that are shown."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = [
        Binding("space", "toggle", "show or hide", id="layers.toggle", tooltip="show this layer or hide it"),
        Binding("escape,l,q", "dismiss", "close", id="layers.close", tooltip="back to the map"),
    ]

    def __init__(self, world: WorldMap, names: tuple[str, ...]) -> None:
        super().__init__()
        self._world, self._names = world, names

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = "What the map shows"
            dialog.border_subtitle = "space or click shows or hides   escape closes"
            yield OptionList(*(Option(self._prompt(name)) for name in self._names), compact=True, markup=False)

    def _prompt(self, name: str) -> Text:
        mark = "[x]" if name in self._world.shown_layers else "[ ]"
        return Text(f"{mark} {name:<11} ", no_wrap=True).append(MEANINGS.get(name, ""), "dim")

    def action_toggle(self) -> None:
        place = self.query_one(OptionList).highlighted
        if place is not None:
            self._toggle(place)

    @on(OptionList.OptionSelected)
    def _selected(self, event: OptionList.OptionSelected) -> None:
        self._toggle(event.option_index)

    def _toggle(self, place: int) -> None:
        name = self._names[place]
        self._world.toggle_layer(name)
        self.query_one(OptionList).replace_option_prompt_at_index(place, self._prompt(name))
